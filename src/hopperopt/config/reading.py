"""From a raw document to a study, or to one sentence for each of its mistakes."""

from pathlib import Path

from pydantic import ValidationError

from hopperopt import checks
from hopperopt import design as plans
from hopperopt.config.sections import PAPERS_OPTIMUM
from hopperopt.config.study import Study
from hopperopt.document import ConfigError, NotAllowed, mistake, odd_keys, read_text, without_nulls
from hopperopt.mistakes import sentences


def parse(document, directory="."):
    """The study of a raw document; relative paths in it are relative to `directory`.

    Raises ConfigError with one line for each mistake: dotted key, value, and what is allowed.
    """
    if found := list(odd_keys(document)):
        raise ConfigError("\n".join(found))
    entries = ("factors", "optimise.explicit", "verification.cases", "verification.replicates_of")
    document = without_nulls(document, entries)
    study, found, faulty = _models(document)
    study = _with_its_cases(study)
    if not {"insert", "design", "factors"} & faulty:
        study, unread = _with_files(study, Path(directory))
        found += unread
        faulty |= {"insert", "design"} if unread else set()
    found += [*_results_folder(study, Path(directory)), *checks.mistakes(study, faulty)]
    if found:
        raise ConfigError("\n".join(found))
    return study


def _with_its_cases(study):
    """The study without the default case that is a design of the paper's, where its factors are others."""
    verification = study.verification
    if "cases" in verification.model_fields_set or set(study.factors) == set(PAPERS_OPTIMUM):
        return study
    cases = {name: case for name, case in verification.cases.items() if case != PAPERS_OPTIMUM}
    return study.model_copy(update={"verification": verification.model_copy(update={"cases": cases})})


def _models(document):
    """The study, the sentences for its mistakes, and the sections these spoil (there the defaults stand)."""
    try:
        return Study.model_validate(document), [], set()
    except ValidationError as error:
        errors = error.errors(include_url=False)
    spoilt = {str(item["loc"][0]) for item in errors if item["loc"]}
    rest = {key: value for key, value in document.items() if key not in spoilt}
    return Study.model_validate(rest), sentences(errors, Study), spoilt


def _results_folder(study, directory):
    """The sentence for a `results_dir` that no folder can have."""
    path = directory / study.results_dir
    try:
        place = next((place for place in (path, *path.parents) if place.exists()), directory)
    except OSError as error:
        yield mistake("results_dir", study.results_dir, f"the path of a folder ({error.strerror})")
        return
    if not place.is_dir():
        yield mistake("results_dir", study.results_dir, f"the path of a folder ({place} is a file)")


def _with_files(study, directory):
    """The study with its CSV files read, and the sentences for those that cannot be used."""
    found, own = [], study.insert.profile
    if study.insert.shape == "profile" and (own.file is not None or own.points_mm is None):
        try:
            points = plans.points_from_csv("" if own.file is None else read_text(directory / own.file))
            study = study.with_values({"insert.profile.points_mm": points, "insert.profile.file": None})
        except NotAllowed as error:
            found.append(mistake("insert.profile.file", own.file, error))
        except ConfigError as error:
            found.append(f"{error} (from {own.file})")
    if study.design.plan == "csv":
        try:
            text = read_text(directory / study.design.csv.file)
            study._own_plan = plans.from_csv(text, study.levels)
            study._unused_columns = plans.unused_columns(text, study.levels)
        except NotAllowed as error:
            found.append(mistake("design.csv.file", study.design.csv.file, error))
    return study, found
