"""What the user writes: the case file's schema, its reader, and the faults it can have."""

from pbem.case.reader import Case, Draft, parse_case, parse_draft, read_case, read_case_text
from pbem.case.schema import json_schema

__all__ = ["Case", "Draft", "json_schema", "parse_case", "parse_draft", "read_case", "read_case_text"]
