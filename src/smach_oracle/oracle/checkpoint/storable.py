"""Tells which userdata can be stored: the codecs of this program."""

from smach_oracle.store.codecs import CODECS, register_codec

__all__ = ['CODECS', 'register_codec']
