"""What `make quick` leaves out leaves every folder tested."""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]
FOLDERS = sorted({path.parent for path in TESTS.rglob("test_*.py")})
LEFT_OUT = ("pytest.mark.slow", "pytest.mark.timed", "pytest.mark.long")


def has_quick_test(text: str) -> bool:
    """Tell whether a file has a test without such a mark, of the file or of all its parameters."""
    body = ast.parse(text).body
    assigned = " ".join(ast.unparse(node) for node in body if isinstance(node, ast.Assign))
    if "pytestmark" in assigned and any(mark in assigned for mark in LEFT_OUT):
        return False
    tests = [node for node in body if isinstance(node, ast.FunctionDef)]
    return any(
        node.name.startswith("test_")
        and not any(ast.unparse(mark) in LEFT_OUT for mark in node.decorator_list)
        for node in tests
    )


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(TESTS)))
def test_every_folder_of_tests_has_quick_ones(folder):
    assert any(has_quick_test(path.read_text("utf-8")) for path in folder.glob("test_*.py"))


@pytest.mark.parametrize("mark", LEFT_OUT)
def test_marks_are_seen(mark):
    assert not has_quick_test(f"@{mark}\ndef test_a(): ...\ndef c(): ...\n")
    assert not has_quick_test(f"pytestmark = [{mark}]\ndef test_b(): ...\n")
    assert has_quick_test(f"@{mark}\ndef test_a(): ...\ndef test_b(): ...\n")
