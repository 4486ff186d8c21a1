"""What `smach_common.foreign` offers, for the executive."""

from smach_common.foreign import ends_program, error_text, repr_of, text_of, type_name

__all__ = ['ends_program', 'error_text', 'repr_of', 'text_of', 'type_name']
