from __future__ import annotations

from nena_edge_agent.doctor.finding import Link, LinkFinding, LinkVerdict, missing, ok, report, unknown


def test_the_report_names_the_first_missing_link_and_its_remedy() -> None:
    findings = [
        ok(Link.BROKER, "answers"),
        missing(Link.LOGIN, "not let in", "check mqtt.username"),
        *unknown([Link.ACCESS], "needs the login"),
        missing(Link.MAP, "is another", "set map_id"),
    ]

    assert report(findings).splitlines() == [
        "ok        broker        answers",
        "MISSING   login         not let in",
        "                        -> check mqtt.username",
        "-         access        needs the login",
        "MISSING   map           is another",
        "                        -> set map_id",
        "The first missing link: login.",
    ]


def test_a_doubtful_finding_is_not_a_failure() -> None:
    text = report([LinkFinding(Link.CLOCK, LinkVerdict.DOUBTFUL, "nobody keeps it", "have it kept")])

    assert text.endswith("-> have it kept\nNo link is missing.\n")
