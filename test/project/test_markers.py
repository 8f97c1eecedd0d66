"""What `make quick` leaves out leaves every room tested."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]
FOLDERS = sorted({path.parent for path in TESTS.rglob("test_*.py")})


def is_slow(node: ast.FunctionDef) -> bool:
    """Tell whether a test is marked slow as a whole, not for some of its parameters only."""
    return any(ast.unparse(mark) == "pytest.mark.slow" for mark in node.decorator_list)


def quick_tests(path: Path) -> Iterator[str]:
    """Yield the tests of a file that `make quick` runs."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    assigned = [ast.unparse(node) for node in body if isinstance(node, ast.Assign)]
    if any(text.startswith("pytestmark") and "mark.slow" in text for text in assigned):
        return
    tests = [node for node in body if isinstance(node, ast.FunctionDef)]
    for node in tests:
        if node.name.startswith("test_") and not is_slow(node):
            yield node.name


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(TESTS)))
def test_every_folder_of_tests_has_quick_ones(folder):
    tests = [name for path in folder.glob("test_*.py") for name in quick_tests(path)]
    assert tests


def test_marks_are_seen(tmp_path):
    one = tmp_path / "test_one.py"
    one.write_text("@pytest.mark.slow\ndef test_a(): ...\ndef test_b(): ...\ndef c(): ...\n")
    assert list(quick_tests(one)) == ["test_b"]
    one.write_text("pytestmark = [pytest.mark.slow]\ndef test_b(): ...\n")
    assert not list(quick_tests(one))
