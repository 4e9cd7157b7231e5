"""The neural descriptor field: vector-neuron encoder, occupancy decoder, descriptors."""

from roam_goalpose.field.config import FieldConfig
from roam_goalpose.field.decoder import Answer
from roam_goalpose.field.field import Field
from roam_goalpose.field.frame import ObjectFrame, estimate_frame
from roam_goalpose.field.latent import Latent

__all__ = ["Answer", "Field", "FieldConfig", "Latent", "ObjectFrame", "estimate_frame"]
