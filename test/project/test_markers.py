"""What `make quick` leaves out leaves every room tested."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]
FOLDERS = sorted({path.parent for path in TESTS.rglob("test_*.py")})


LEFT_OUT = {"pytest.mark.slow", "pytest.mark.timed"}


def is_left_out(node: ast.FunctionDef) -> bool:
    """Tell whether a test has such a mark as a whole, not for some of its parameters only."""
    return any(ast.unparse(mark) in LEFT_OUT for mark in node.decorator_list)


def quick_tests(path: Path) -> Iterator[str]:
    """Yield the tests of a file that `make quick` runs."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    assigned = [ast.unparse(node) for node in body if isinstance(node, ast.Assign)]
    marks = " ".join(text for text in assigned if text.startswith("pytestmark"))
    if any(mark in marks for mark in LEFT_OUT):
        return
    tests = [node for node in body if isinstance(node, ast.FunctionDef)]
    for node in tests:
        if node.name.startswith("test_") and not is_left_out(node):
            yield node.name


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(TESTS)))
def test_every_folder_of_tests_has_quick_ones(folder):
    tests = [name for path in folder.glob("test_*.py") for name in quick_tests(path)]
    assert tests


def test_marks_are_seen(tmp_path):
    one = tmp_path / "test_one.py"
    for mark in sorted(LEFT_OUT):
        one.write_text(f"@{mark}\ndef test_a(): ...\ndef test_b(): ...\ndef c(): ...\n")
        assert list(quick_tests(one)) == ["test_b"]
        one.write_text(f"pytestmark = [{mark}]\ndef test_b(): ...\n")
        assert not list(quick_tests(one))
