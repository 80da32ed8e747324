"""What pictures are written as beside PNG, chosen before matplotlib is imported."""

from contextvars import ContextVar

FORMATS = ("pdf", "svg")
further_formats: ContextVar[tuple[str, ...]] = ContextVar("further_formats", default=())
