"""The tiny study of the workflow's tests, for the cluster."""

from tests.workflow.conftest import finished, new_study  # noqa: F401
