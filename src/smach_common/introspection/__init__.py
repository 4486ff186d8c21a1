"""A machine's structure and status, published for viewers, for our engine and for upstream's."""

from .introspection_server import IntrospectionServer

__all__ = ['IntrospectionServer']
