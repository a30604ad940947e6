"""ARServer, Project, Scene, Build and Execution services in one ASGI application, and the command line."""
