"""All hidden forms of the causes, by cause."""

from __future__ import annotations

from . import effects_channel, effects_memory, effects_mixing, effects_time
from .bench import Form

FORMS: tuple[Form, ...] = (
    *effects_memory.FORMS,
    *effects_mixing.FORMS,
    *effects_channel.FORMS,
    *effects_time.FORMS,
)

CAUSES: tuple[str, ...] = tuple(dict.fromkeys(form.cause for form in FORMS))


def forms_of(cause: str) -> tuple[Form, ...]:
    """Return the forms of a cause."""
    return tuple(form for form in FORMS if form.cause == cause)


def form_called(cause: str, name: str) -> Form:
    """Return one form."""
    return next(form for form in FORMS if (form.cause, form.name) == (cause, name))
