"""Bad input, said in one line: where, which key, which value, what is allowed."""

from __future__ import annotations

__all__ = ["InputError"]


class InputError(ValueError):
    """Input that cannot be used; its text is one line that names the mend."""

    def __init__(self, where: str, key: str, value: object, allowed: str) -> None:
        self.where, self.key, self.value, self.allowed = where, key, value, allowed
        parts = [str(where)] if where else []
        parts.append(f"{key} = {_short(value)}" if value is not None else key)
        super().__init__(f"{': '.join(parts)}; {allowed}")


def _short(value: object) -> str:
    text = repr(value) if isinstance(value, str) else str(value)
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
