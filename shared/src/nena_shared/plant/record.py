"""What all records of a plant model have in common."""

from pydantic import BaseModel, ConfigDict
from pydantic.alias_generators import to_camel


class PlantRecord(BaseModel):
    """An immutable record; its JSON names are camelCase, and names from a newer writer are passed over."""

    model_config = ConfigDict(
        frozen=True,
        alias_generator=to_camel,
        populate_by_name=True,
        extra="ignore",
        allow_inf_nan=False,
    )
