"""The topics that a site uses, as the settings of its services name them."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from nena_shared.vda5050.topics import TopicScheme


class SiteTopics(BaseModel):
    """First levels of the topics at the broker."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    interface_name: str = "uagv"
    interface_name_v3: str = "vda5050"
    prefix: str = "nena/v1"

    @property
    def schemes(self) -> tuple[TopicScheme, ...]:
        """The topics of robots, for each major version of VDA 5050."""
        return (TopicScheme(self.interface_name, "v2"), TopicScheme(self.interface_name_v3, "v3"))
