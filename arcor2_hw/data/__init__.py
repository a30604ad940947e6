"""Protocol and storage types: msgspec Structs with the field names of the wire."""
