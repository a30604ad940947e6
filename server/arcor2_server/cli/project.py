"""`arcor2-hw project`: list, export, import, check and compare projects."""

from arcor2_hw.client.rest import Rest
from arcor2_server.cli.document_commands import DocumentKind, document_commands
from arcor2_server.exchange.export import Exporter

app = document_commands(
    DocumentKind(
        name="project",
        saved=Rest.projects,
        export=Exporter.project,
        content="its scene, object types, models and meshes",
        sources="A file that `arcor2-hw project export` wrote, or an execution package.",
        parts="project, scene, types (with their models), assets",
        packages=", or execution packages,",
    )
)
