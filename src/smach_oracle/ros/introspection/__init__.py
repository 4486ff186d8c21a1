"""The introspection server of our stand-in, for scripts that run on upstream's `smach_ros`."""

from smach_common.introspection import IntrospectionServer

__all__ = ['IntrospectionServer']
