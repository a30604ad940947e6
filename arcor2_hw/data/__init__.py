"""What travels and what is stored, as msgspec Structs with the field names of the wire."""
