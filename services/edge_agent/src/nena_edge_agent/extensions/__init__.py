"""Extensions of the edge agent that come with it."""
