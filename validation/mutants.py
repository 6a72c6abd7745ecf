"""Mutants of a module's functions: for each sign and each factor a copy of the text in which it is wrong."""

import ast
from dataclasses import dataclass
from pathlib import Path

OTHER_SIGN = {ast.Add: ast.Sub, ast.Sub: ast.Add}
OTHER_EXTREME = {"min": "max", "max": "min"}
LARGER = 1.25  # times every constant


@dataclass(frozen=True)
class Mutant:
    """One change in a module: in which function, line and numbered place, and the module's text with it."""

    module: str
    function: str
    line: int
    place: int
    change: str
    source: str

    def __str__(self):
        return f"{self.module}.{self.function}, line {self.line}: {self.change}"


@dataclass(frozen=True)
class Place:
    """Where a node hangs in a function's syntax tree, so that another can be hung there."""

    function: str
    statement: ast.AST  # the statement that the node belongs to; of an `if` or a loop its head alone
    parent: ast.AST
    field: str
    index: int | None

    @property
    def node(self):
        value = getattr(self.parent, self.field)
        return value if self.index is None else value[self.index]

    def put(self, node):
        ast.fix_missing_locations(node)
        if self.index is None:
            setattr(self.parent, self.field, node)
        else:
            getattr(self.parent, self.field)[self.index] = node


def changed(node):
    """What may stand in a node's place, one mutant each."""
    if isinstance(node, ast.BinOp):
        yield from _changed_operation(node, node.left, node.right)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield node.operand
    elif isinstance(node, ast.AugAssign) and type(node.op) in OTHER_SIGN:
        yield ast.AugAssign(node.target, OTHER_SIGN[type(node.op)](), node.value)
    elif isinstance(node, ast.AugAssign):
        yield ast.AugAssign(node.target, node.op, ast.Constant(1.0))
    elif isinstance(node, ast.Call) and getattr(node.func, "id", None) in OTHER_EXTREME:
        yield ast.Call(ast.Name(OTHER_EXTREME[node.func.id]), node.args, node.keywords)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value != 0.0:
        yield ast.Constant(LARGER * node.value)


def _changed_operation(node, left, right):
    """Each term of a sum with its sign turned; a product, quotient or power without each of its factors.

    The left operand of a longer sum or product is one itself: its parts have their turn there.
    """
    if _is(node, ast.Add, ast.Sub):
        yield ast.BinOp(left, OTHER_SIGN[type(node.op)](), right)
        if not _is(left, ast.Add, ast.Sub):
            yield ast.BinOp(ast.UnaryOp(ast.USub(), left), node.op, right)
    elif _is(node, ast.Mult, ast.Div):
        yield left
        if _is(node, ast.Mult) and not _is(left, ast.Mult, ast.Div):
            yield right
        elif not _is(left, ast.Mult, ast.Div) and getattr(left, "value", None) != 1.0:
            yield ast.BinOp(ast.Constant(1.0), node.op, right)
    elif _is(node, ast.Pow):
        yield left
        if isinstance(right, ast.Constant):
            yield ast.BinOp(left, node.op, ast.Constant(right.value + 1))


def _is(node, *operators):
    return isinstance(node, ast.BinOp) and isinstance(node.op, operators)


def _places(function, parent, statement=None):
    """All places below a node, in the order of the text, without the insides of subscripts."""
    for field, value in ast.iter_fields(parent):
        if field == "slice" or (isinstance(parent, ast.FunctionDef) and field != "body"):
            continue
        for index, child in enumerate(value if isinstance(value, list) else [value]):
            if isinstance(child, ast.AST):
                of_block = isinstance(parent, ast.stmt) and hasattr(parent, "body")
                belongs = child if of_block else statement
                yield Place(function, belongs, parent, field, index if isinstance(value, list) else None)
                yield from _places(function, child, belongs)


def parsed(path, names, aside=()):
    """Parse a module. Returns its tree and its numbered places where something may change.

    Arguments: `names` of its functions, "*" for all; `aside`, variables: statements that speak of one of them
    are left out. Raises ValueError for a function that is not there.
    """
    tree = ast.parse(Path(path).read_text(encoding="utf-8"))
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    names = functions if names == "*" else names
    if missing := [name for name in names if name not in functions]:
        raise ValueError(f"{path} has no function {', '.join(missing)}")
    places = [
        place
        for name in names
        for place in _places(name, functions[name])
        if any(True for _ in changed(place.node))
        and not any(getattr(node, "id", None) in aside for node in ast.walk(place.statement))
    ]
    return tree, list(enumerate(places))


def mutants(path, names, aside=()):
    """All mutants of a module's functions (see `parsed`), none twice."""
    tree, places = parsed(path, names, aside)
    found = {}
    for number, place in places:
        node = place.node
        for other in list(changed(node)):
            place.put(other)
            source = ast.unparse(tree)
            place.put(node)
            change = f"{ast.unparse(node)} -> {ast.unparse(other)}"
            mutant = Mutant(Path(path).stem, place.function, node.lineno, number, change, source)
            found.setdefault(source, mutant)
    return list(found.values())


def observed(path, names, aside, recorder):
    """The module's text with every place calling `recorder(number, value)`, a name, for its value."""
    tree, places = parsed(path, names, aside)
    for number, place in reversed(places):  # inner places first
        node = place.node
        value = node.value if isinstance(node, ast.AugAssign) else node
        call = ast.Call(ast.Name(recorder), [ast.Constant(number), value], [])
        if isinstance(node, ast.AugAssign):
            node.value = call
        else:
            place.put(call)
    return ast.unparse(ast.fix_missing_locations(tree))
