"""`arcor2-hw scene`: list, export, import, check and compare scenes."""

from arcor2_hw.client.rest import Rest
from arcor2_server.cli.document_commands import DocumentKind, document_commands
from arcor2_server.exchange.export import Exporter

app = document_commands(
    DocumentKind(
        name="scene",
        saved=Rest.scenes,
        export=Exporter.scene,
        content="its object types, models and meshes",
        sources="A file that `arcor2-hw scene export` or `project export` wrote.",
        parts="scene, types (with their models), assets",
    )
)
