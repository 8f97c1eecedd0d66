# SPDX-License-Identifier: Apache-2.0
"""One HTML file with the scene as it is and a report beside it, to send to somebody."""

import html
import re
from typing import Any

from rover_planner.viewer.browser import label_script

STYLE = """
#report { position: fixed; top: 0; left: 0; bottom: 0; width: 34em; overflow: auto; z-index: 10;
  background: rgba(255, 255, 255, .92); padding: .5em 1em; font: 13px/1.4 sans-serif;
  box-sizing: border-box; color: #222; }
#report th { text-align: left; vertical-align: top; padding-right: .8em; font-weight: normal;
  opacity: .7; }
#report td { padding-right: .6em; overflow-wrap: anywhere; }
#report h1 { font-size: 1.5em; }
#report #wheels th { white-space: nowrap; }
#report #wheels td { text-align: right; }
.label-box[data-path] { pointer-events: none; }
.mantine-Notifications-root { top: auto !important; left: auto !important; right: 8px;
  bottom: 8px; }
@media (max-width: 1000px) { #report { top: auto; right: 0; width: auto; height: 45%; } }
"""
VISERS_TITLE = re.compile("<title>.*?</title>")
"""The title that viser gives a file; a browser shows the first one."""


def write_page(server: Any, camera: Any, report: str, title: str, labels: str) -> bytes:
    """Return the scene and a report as one HTML file that needs no network.

    Args:
        server: The server of viser.
        camera: The camera of the visitor, from which the file looks at first.
        report: The report, HTML.
        title: Title of the file, text.
        labels: The labels of the scene for the script that keeps them apart, HTML.
    """
    server.initial_camera.position = camera.position
    server.initial_camera.look_at = camera.look_at
    safe = html.escape(title)
    page: str = server.get_scene_serializer().as_html()
    page = VISERS_TITLE.sub(lambda _found: f"<title>{safe}</title>", page, count=1)
    inserted = (
        f"<style>{STYLE}</style>"
        f'<div id="report"><h1>{safe}</h1>{report}</div>{labels}'
        f"<script>{label_script.SCRIPT}</script>"
    )
    at = page.rindex("</body>")
    return (page[:at] + inserted + page[at:]).encode()
