"""The neural descriptor field: vector-neuron encoder, occupancy decoder, descriptors."""

from goalpose.field.config import FieldConfig
from goalpose.field.decoder import Answer
from goalpose.field.field import Field
from goalpose.field.frame import ObjectFrame, estimate_frame
from goalpose.field.latent import Latent

__all__ = ["Answer", "Field", "FieldConfig", "Latent", "ObjectFrame", "estimate_frame"]
