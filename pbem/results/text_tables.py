"""Sections and aligned tables of short texts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

MOST_ROWS = 40


def section(title: str, lines: Iterable[str]) -> str:
    """A title with its lines below; nothing without lines."""
    listed = list(lines)
    return "\n".join([title, *(f"  {line}" for line in listed)]) if listed else ""


def table(titles: Sequence[str], rows: Sequence[Sequence[str]], most: int = MOST_ROWS) -> list[str]:
    """Aligned lines, numbers to the right; at most so many of them."""
    if not rows:
        return []
    shown = [titles, *rows[:most]]
    widths = [max(len(row[i]) for row in shown) for i in range(len(titles))]
    right = [all(_is_number(row[i]) for row in rows) for i in range(len(titles))]
    lines = ["  ".join(cell.rjust(width) if flush else cell.ljust(width)
                       for cell, width, flush in zip(row, widths, right, strict=True)).rstrip() for row in shown]
    return lines + ([f"... and {len(rows) - most} more"] if len(rows) > most else [])


def shorten(texts: Sequence[str], most: int = MOST_ROWS) -> list[str]:
    """The first texts, and how many there are more."""
    return [*texts[:most], *([f"... and {len(texts) - most} more"] if len(texts) > most else [])]


def shorten_between(texts: Sequence[str], most: int) -> list[str]:
    """The first and the last texts, and how many there are between."""
    if len(texts) <= most:
        return list(texts)
    first, last = most - most // 2, most // 2
    return [*texts[:first], f"... {len(texts) - most} more ...", *texts[len(texts) - last :]]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def format_number(value: float) -> str:
    """Five digits."""
    return f"{value:.5g}"


def format_bytes(size: float) -> str:
    """Three digits with a unit: B, kB, MB, GB, TB of powers of 1000."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"
