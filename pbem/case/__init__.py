"""Case files: their reader, which says every fault with its line, and what writes them."""

from pbem.case.reader import Draft, parse_case, parse_draft, read_case, read_case_text
from pbem.description.case import Case
from pbem.description.schema import json_schema

__all__ = ["Case", "Draft", "json_schema", "parse_case", "parse_draft", "read_case", "read_case_text"]
