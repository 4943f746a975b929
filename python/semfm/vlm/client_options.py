"""The options of commands that ask an endpoint."""

from __future__ import annotations

import argparse
from typing import Any

from .client import ClientSettings


def add_client_options(group: argparse._ArgumentGroup, default: ClientSettings, noun: str) -> None:
    """Adds model, address, cache and patience; ``noun``: what is kept in the cache."""
    group.add_argument("--model", metavar="NAME", help="at the endpoint")
    group.add_argument("--base-url", metavar="URL", help=f"of the interface ({default.base_url})")
    group.add_argument("--cache", metavar="DIR", help=f"keep {noun}, ask nothing twice")
    group.add_argument(
        "--timeout",
        type=float,
        default=default.timeout_s,
        metavar="S",
        help="of a request (%(default)s)",
    )
    group.add_argument(
        "--retries",
        type=int,
        default=default.max_attempts - 1,
        metavar="N",
        help="more (%(default)s)",
    )
    group.add_argument(
        "--max-wait",
        type=float,
        default=default.max_wait_s,
        metavar="S",
        help="between two (%(default)s)",
    )


def patience(args: argparse.Namespace) -> dict[str, Any]:
    """What the options say of patience, as settings take it."""
    return {
        "timeout_s": args.timeout,
        "max_attempts": args.retries + 1,
        "max_wait_s": args.max_wait,
    }
