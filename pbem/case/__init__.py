"""Case files: reader and writer. Keys and their types are in `pbem.description.schema`, the model in `pbem.model`."""

from pbem.case.case import Case, parse_case, read_case
from pbem.case.reader import FileDraft, parse_draft, read_case_text
from pbem.description.schema import json_schema

__all__ = ["Case", "FileDraft", "json_schema", "parse_case", "parse_draft", "read_case", "read_case_text"]
