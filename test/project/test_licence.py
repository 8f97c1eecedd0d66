# SPDX-License-Identifier: Apache-2.0
"""Each source file names its licence in its first line, as REP-2004 and SPDX ask.

A new file begins with the line of this one, above its docstring, followed by no blank line.
"""

import pytest

from support.project.checkout import TOP

LINE = "# SPDX-License-Identifier: Apache-2.0"
FOLDERS = ("rover_physics", "msg_adapters", "rover_planner", "support", "benchmarks", "test",
           "examples", "launch")  # fmt: skip


@pytest.mark.parametrize("folder", [*FOLDERS, "."])
def test_each_python_file_names_its_licence_in_its_first_line(folder):
    files = [*(TOP / folder).glob("*.py" if folder == "." else "**/*.py")]
    assert files
    named = {path for path in files if path.read_text(encoding="utf-8").startswith(f"{LINE}\n")}
    assert not sorted(str(path.relative_to(TOP)) for path in set(files) - named)
