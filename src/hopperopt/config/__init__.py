"""The study's configuration: a document becomes frozen models, and these give each stage its plain values.

Millimetres and degrees in the document, SI in the case of a simulation. The models' defaults are the paper's
study. Nothing else imports pydantic.
"""

from hopperopt.config.reading import parse
from hopperopt.config.setup import Setup, derived_case
from hopperopt.config.study import Study
from hopperopt.document import ConfigError, load

__all__ = ["ConfigError", "Setup", "Study", "derived_case", "load", "parse"]
