"""One HTML file with the scene as it is and a report beside it, to send to somebody."""

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


def write_page(server: Any, camera: Any, report: str, title: str, labels: str) -> bytes:
    """Return the scene and a report as one HTML file that needs no network.

    Args:
        server: The server of viser.
        camera: The camera of the visitor, from which the file looks at first.
        report: The report, HTML.
        title: Title of the file, HTML.
        labels: The labels of the scene for the script that keeps them apart, HTML.
    """
    server.initial_camera.position = camera.position
    server.initial_camera.look_at = camera.look_at
    page: str = server.get_scene_serializer().as_html()
    inserted = (
        f"<style>{STYLE}</style><title>{title}</title>"
        f'<div id="report"><h1>{title}</h1>{report}</div>{labels}'
        f"<script>{label_script.SCRIPT}</script>"
    )
    at = page.rindex("</body>")
    return (page[:at] + inserted + page[at:]).encode()
