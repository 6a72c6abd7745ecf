"""Choosing one design from a Pareto front of two objectives, both to be small."""

import numpy as np


def select(
    rule: str, objectives: np.ndarray, centre: np.ndarray, error: np.ndarray | None = None
) -> tuple[int, str, str | None]:
    """Choose a point of the front.

    rule: "knee" or "compromise"; objectives: (n, 2) J_f and J_i of the front's points; centre: (2,) J of the
    plan's centre, which puts the objectives on one scale in a compromise; error: (2,) uncertainty of the
    predicted J, None if unknown. Returns (index, the rule that was applied, a warning or None). A front
    without a knee, or shorter than the uncertainty, gives the compromise.
    """
    objectives = np.asarray(objectives, dtype=float)
    if rule == "compromise":
        return compromise(objectives, centre), "compromise", None
    if rule != "knee":
        raise ValueError(f"select: {rule!r} is not allowed; allowed: knee, compromise, explicit")
    index, reason = knee(objectives, error)
    if index is not None:
        return index, "knee", None
    return compromise(objectives, centre), "compromise", f"no knee, the best compromise instead: {reason}"


def knee(objectives: np.ndarray, error: np.ndarray | None = None) -> tuple[int | None, str | None]:
    """Point farthest from the chord between the front's extremes, on the side of small objectives.

    The axes are normalised by the front, the extremes at (0, 1) and (1, 0). A point beyond the chord is no
    knee however far it is: there, mixing the extremes would be better. Nor has a front a knee whose ranges in
    both objectives are below their uncertainty, error (2,). Returns (index, None), or (None, the reason).
    """
    if len(objectives) < 3:
        return None, f"the front has {len(objectives)} point{'s' if len(objectives) > 1 else ''}"
    low, high = objectives.min(axis=0), objectives.max(axis=0)
    if error is not None and (high - low < error).all():
        ranges = ", ".join(
            f"{name} spans {span:.2g}, its uncertainty is {limit:.2g}"
            for name, span, limit in zip(("J_f", "J_i"), high - low, error, strict=True)
        )
        return None, f"the front is shorter than the predictions' uncertainty ({ranges})"
    if not (high > low).all():
        return None, "the front has no length"
    distance = (1 - ((objectives - low) / (high - low)).sum(axis=1)) / np.sqrt(2)
    # Rounding puts the extremes themselves a hair off their chord.
    if distance.max() < 1e-9:
        return None, "the front bulges away from small objectives"
    return int(np.argmax(distance)), None


def compromise(objectives: np.ndarray, centre: np.ndarray) -> int:
    """Index of the point with the smallest J_f / J_f,centre + J_i / J_i,centre."""
    return int(np.argmin((objectives / np.asarray(centre)).sum(axis=1)))
