"""What a machine is and does, published for viewers: for our engine and for upstream's."""
from .introspection_server import IntrospectionServer

__all__ = ['IntrospectionServer']
