"""``nena-deploy``."""

from __future__ import annotations

from nena_deploy.commands import app

if __name__ == "__main__":
    app()
