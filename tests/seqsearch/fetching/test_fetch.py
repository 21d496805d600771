"""Fetching: complete or not at all, tried again, resumed, and one line where it fails."""

import base64
import gzip
import hashlib
import json
import socket

import numpy as np
import pytest

from feasibility import InputError
from feasibility.orbits import read_catalogue
from seqsearch.commands.cli import main
from seqsearch.fetching.download import Patience, fetch
from seqsearch.fetching.horizons import horizons_spk
from seqsearch.fetching.mpcorb import mpcorb
from seqsearch.fetching.record import read_record, record_path
from seqsearch.fetching.sbdb import sbdb
from tests.helpers.kernels import kepler_states, write_kernel
from tests.helpers.web_service import Answer, ranged, web_service

QUICK = Patience(retries=2, pause_s=0.01)
"""Three tries in all."""

ROW = (
    "00001    3.34  0.15 K2555 231.53975   73.29974   80.24963   10.58789  0.0794013  0.21429254"
    "   2.7660512  0 E2024-V47  7330 125 1801-2024 0.80 M-v 30k MPCLINUX   4000      (1) Ceres"
    "              20241101"
)
"""Ceres in the MPC's columns."""


def mpcorb_file(rows=2000, seed=1):
    """Return a gzipped table that does not compress to nothing."""
    rng = np.random.default_rng(seed)
    lines = [ROW[:8] + f"{rng.random():6.2f}"[:5] + ROW[13:] for _ in range(rows)]
    lines = [f"{number:05d}" + line[5:26] + f"{rng.uniform(0, 360):9.5f}" + line[35:]
             for number, line in enumerate(lines, 1)]  # fmt: skip
    return gzip.compress("\n".join(["header", "-" * 160, *lines, ""]).encode())


SBDB_ANSWER = {
    "signature": {"source": "NASA/JPL Small-Body Database (SBDB) Query API", "version": "1.0"},
    "fields": ["spkid", "full_name", "epoch", "a", "e", "i", "om", "w", "ma", "H"],
    "data": [
        ["20000001", "     1 Ceres (A801 AA)", "2461000.5", "2.77", "0.0796", "10.59", "80.25",
         "73.30", "231.54", "3.34"],
        ["20000433", "   433 Eros (A898 PA)", "2461000.5", "1.458", "0.2228", "10.83", "304.27",
         "178.93", "310.55", None],
    ],
    "count": 2,
}  # fmt: skip


def sbdb_answer(**changes):
    return Answer(json.dumps(SBDB_ANSWER | changes).encode(), kind="application/json")


def left(folder):
    """Return the names of the files in a folder."""
    return sorted(file.name for file in folder.iterdir())


def test_mpcorb_is_fetched_once_and_recorded(tmp_path):
    content = mpcorb_file()
    with web_service(lambda asked, _: ranged(content, asked)) as service:
        target = tmp_path / "MPCORB.DAT.gz"
        record, now = fetch(mpcorb(target, url=service.url), patience=QUICK)
        again, later = fetch(mpcorb(target, url=service.url), patience=QUICK)
        assert (now, later) == (True, False)
        assert again == record == read_record(target)
        assert [asked.path for asked in service.asked] == ["/iau/MPCORB/MPCORB.DAT.gz"]
        _, anew = fetch(mpcorb(target, url=service.url), refresh=True, patience=QUICK)
        assert anew
    assert target.read_bytes() == content
    assert record.sha256 == hashlib.sha256(content).hexdigest()
    assert record.url == f"{service.url}/iau/MPCORB/MPCORB.DAT.gz"
    assert left(tmp_path) == ["MPCORB.DAT.gz", "MPCORB.DAT.gz.source.json"]


def test_a_busy_server_is_asked_again(tmp_path):
    content = mpcorb_file()
    with web_service(
        lambda asked, n: Answer(status=500) if n < 2 else ranged(content, asked)
    ) as service:
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
        assert len(service.asked) == 3
    assert (tmp_path / "m.gz").read_bytes() == content


@pytest.mark.parametrize("status", [500, 503, 429])
def test_a_server_that_stays_busy_is_left_with_the_old_file_intact(tmp_path, status):
    target = tmp_path / "m.gz"
    content = mpcorb_file()
    answers = [lambda asked: ranged(content, asked)]
    with web_service(lambda asked, _: answers[-1](asked)) as service:
        fetch(mpcorb(target, url=service.url), patience=QUICK)
        before = target.stat().st_mtime_ns, record_path(target).read_bytes()
        answers.append(lambda _: Answer(status=status))
        with pytest.raises(InputError, match=rf"error {status} .*3 times") as error:
            fetch(mpcorb(target, url=service.url), refresh=True, patience=QUICK)
    assert "\n" not in str(error.value)
    assert target.read_bytes() == content
    assert (target.stat().st_mtime_ns, record_path(target).read_bytes()) == before


def test_a_cut_connection_is_resumed_where_it_broke(tmp_path):
    content = mpcorb_file()
    half = len(content) // 2
    with web_service(
        lambda asked, n: ranged(content, asked, cut_at=half if n == 0 else None)
    ) as service:
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
        assert [asked.range_from for asked in service.asked] == [None, half]
    assert (tmp_path / "m.gz").read_bytes() == content


def test_a_part_is_kept_for_the_next_command(tmp_path):
    content = mpcorb_file()
    third = len(content) // 3
    tries = QUICK.retries + 1
    with web_service(
        lambda asked, n: (
            ranged(content, asked, cut_at=10 if 0 < n < tries else third)
            if n < tries
            else ranged(content, asked)
        )
    ) as service:
        with pytest.raises(InputError, match=f"cut, {tries} times.*kept for the next try"):
            fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
        assert not (tmp_path / "m.gz").exists()
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
        assert service.asked[-1].range_from == third + 10 * QUICK.retries
    assert (tmp_path / "m.gz").read_bytes() == content
    assert left(tmp_path) == ["m.gz", "m.gz.source.json"]


def test_a_part_of_another_file_is_not_gone_on_with(tmp_path):
    old, new = mpcorb_file(seed=1), mpcorb_file(seed=2)
    tries = QUICK.retries + 1

    def answer(asked, n):
        if n < tries:
            return ranged(old, asked, cut_at=1000)
        # The file has changed, but this server does not look at If-Range.
        return ranged(new, asked)

    with web_service(answer) as service:
        with pytest.raises(InputError):
            fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
    assert (tmp_path / "m.gz").read_bytes() == new


def test_a_part_that_does_not_fit_the_rest_is_begun_anew(tmp_path):
    old, new = (
        gzip.compress((ROW.replace("00001", number) + "\n").encode() * 200, compresslevel=0)
        for number in ("00001", "00002")
    )
    assert len(old) == len(new)
    tries = QUICK.retries + 1

    def answer(asked, n):
        return ranged(old, asked, cut_at=1000) if n < tries else ranged(new, asked)

    with web_service(answer) as service:
        with pytest.raises(InputError, match="cut"):
            fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
    assert (tmp_path / "m.gz").read_bytes() == new


def test_a_server_without_ranges_sends_all_of_it_again(tmp_path):
    content = mpcorb_file()
    with web_service(
        lambda _, n: Answer(content, cut_at=len(content) // 2 if n == 0 else None)
    ) as service:
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
    assert (tmp_path / "m.gz").read_bytes() == content


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"<!DOCTYPE html><html>please log in</html>", "web page"),
        (b"", "nothing"),
        (mpcorb_file()[:5000], "cut off or damaged"),
        (b"just text, no gzip", "something else"),
        (gzip.compress(b"short rows\n" * 50, mtime=0), "long rows"),
        (gzip.compress(b"<html>packed</html>", mtime=0), "web page"),
    ],
)
def test_what_is_no_table_never_replaces_one(tmp_path, content, words):
    target = tmp_path / "m.gz"
    good = mpcorb_file()
    with web_service(
        lambda asked, n: ranged(good, asked) if n == 0 else Answer(content)
    ) as service:
        fetch(mpcorb(target, url=service.url), patience=QUICK)
        with pytest.raises(InputError, match=words) as error:
            fetch(mpcorb(target, url=service.url), refresh=True, patience=QUICK)
    assert "as it was" in str(error.value)
    assert target.read_bytes() == good
    assert left(tmp_path) == ["m.gz", "m.gz.source.json"]


def test_another_checksum_is_refused(tmp_path):
    content = mpcorb_file()
    digest = hashlib.sha256(content).hexdigest()
    with web_service(lambda asked, _: ranged(content, asked)) as service:
        with pytest.raises(InputError, match="SHA-256"):
            fetch(mpcorb(tmp_path / "m.gz", url=service.url, sha256="0" * 64), patience=QUICK)
        assert left(tmp_path) == []
        fetch(mpcorb(tmp_path / "m.gz", url=service.url, sha256=digest), patience=QUICK)
        with pytest.raises(InputError, match="SHA-256"):
            fetch(mpcorb(tmp_path / "m.gz", url=service.url, sha256="0" * 64), patience=QUICK)
    assert (tmp_path / "m.gz").read_bytes() == content


def test_a_file_that_was_damaged_later_is_fetched_anew(tmp_path):
    content = mpcorb_file()
    target = tmp_path / "m.gz"
    with web_service(lambda asked, _: ranged(content, asked)) as service:
        fetch(mpcorb(target, url=service.url), patience=QUICK)
        target.write_bytes(content[:100])
        _, now = fetch(mpcorb(target, url=service.url), patience=QUICK)
    assert now
    assert target.read_bytes() == content


def test_a_file_of_the_users_own_is_not_overwritten(tmp_path):
    target = tmp_path / "m.gz"
    target.write_bytes(b"mine")
    with pytest.raises(InputError, match="not fetched"):
        fetch(mpcorb(target, url="http://127.0.0.1:1"), patience=QUICK)
    assert target.read_bytes() == b"mine"


def _free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def test_offline_is_one_line_and_what_is_there_needs_no_network(tmp_path, capsys):
    url = f"http://127.0.0.1:{_free_port()}"
    options = ["fetch", "mpcorb", "--url", url, "--out", str(tmp_path / "m.gz"), "--retries", "0"]
    assert main(options) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "refused" in said
    assert "offline" in said
    assert left(tmp_path) == []
    content = mpcorb_file()
    with web_service(lambda asked, _: ranged(content, asked)) as service:
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
    _, now = fetch(mpcorb(tmp_path / "m.gz", url=service.url), patience=QUICK)
    assert not now
    with pytest.raises(InputError, match="offline"):
        fetch(mpcorb(tmp_path / "m.gz", url=service.url), refresh=True, patience=Patience(0))
    assert (tmp_path / "m.gz").read_bytes() == content


@pytest.mark.parametrize("url", ["nowhere", "ftp://host/file", "http://"])
def test_an_address_that_is_none_is_named(tmp_path, url):
    with pytest.raises(InputError):
        fetch(mpcorb(tmp_path / "m.gz", url=url), patience=QUICK)


def test_a_query_of_the_small_body_database_is_read_as_a_catalogue(tmp_path, capsys):
    with web_service(lambda *_: sbdb_answer()) as service:
        table = tmp_path / "big.csv"
        arguments = ["--class", "MBA,APO", "--where", "H < 12", "--where", "a|RG|1.2|3.2"]
        options = ["--query", "sb-ns=n", "--out", str(table), "--url", service.url, "--json"]
        assert main(["fetch", "sbdb", *arguments, *options]) == 0
        query = service.asked[0].query
    assert json.loads(capsys.readouterr().out)["files"][0]["fetched_now"]
    assert query["sb-class"] == "MBA,APO"
    assert json.loads(query["sb-cdata"]) == {"AND": ["H|LT|12", "a|RG|1.2|3.2"]}
    assert query["sb-ns"] == "n"
    assert {"spkid", "epoch", "ma"} <= set(query["fields"].split(","))
    catalogue = read_catalogue(table)
    assert catalogue.ids.tolist() == [20000001, 20000433]


def test_the_json_is_kept_as_it_came(tmp_path, monkeypatch):
    with web_service(lambda *_: sbdb_answer()) as service:
        monkeypatch.setenv("SEQSEARCH_SBDB_URL", service.url)
        fetch(sbdb(tmp_path / "all.json"), patience=QUICK)
        assert service.asked[0].path == "/sbdb_query.api"
    assert json.loads((tmp_path / "all.json").read_text()) == SBDB_ANSWER


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (sbdb_answer(count=3), "says that there are 3"),
        (sbdb_answer(data=[], count=0), "knows no body"),
        (sbdb_answer(data=[["1"]], count=1), "without 10 values"),
        (Answer(b'{"signature": {}, "fie'), "no complete JSON"),
        (Answer(b"[1, 2]"), "another kind"),
        (Answer(b'{"message": "invalid field"}'), "invalid field"),
        (Answer(b"<html>maintenance</html>", kind="text/html"), "web page"),
        (Answer(b'{"code": "400", "message": "bad sb-class"}', status=400), "bad sb-class"),
        (Answer(b"nothing", status=404), "404"),
    ],
)
def test_other_answers_of_the_database_are_refused_in_one_line(tmp_path, answer, words):
    with (
        web_service(lambda *_: answer) as service,
        pytest.raises(InputError, match=words) as error,
    ):
        fetch(sbdb(tmp_path / "all.json", url=service.url), patience=QUICK)
    assert "\n" not in str(error.value)
    assert left(tmp_path) == []


@pytest.mark.parametrize(
    "options",
    [
        ["--where", "a <"],
        ["--where", "a < 3; drop"],
        ["--query", "sb-ns"],
        ["--fields", "a,e,i"],
        ["--retries", "-1"],
        ["--sha256", "abc"],
    ],
)
def test_options_that_cannot_be_used_are_named(tmp_path, capsys, options):
    assert main(["fetch", "sbdb", "--out", str(tmp_path / "s.json"), *options]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert options[0] in said


def _kernel_answer(kernel, **changes):
    answer = {
        "signature": {"version": "1.2", "source": "NASA/JPL Horizons API"},
        "spk_file_id": "20000001",
        "spk": base64.b64encode(kernel).decode(),
    }
    return Answer(json.dumps(answer | changes).encode(), kind="application/json")


@pytest.fixture
def kernel(tmp_path):
    file = tmp_path / "made" / "kernel.bsp"
    file.parent.mkdir()
    write_kernel(file, 20000001, kepler_states(0), 11000.0, 13000.0)
    return file.read_bytes()


def test_kernels_of_horizons_are_written_and_read(tmp_path, kernel):
    folder = tmp_path / "kernels"
    with web_service(lambda *_: _kernel_answer(kernel)) as service:
        span = ["--start", "2030-01-01", "--stop", "2035-01-01"]
        options = ["--url", service.url, "--out", str(folder)]
        assert main(["fetch", "horizons-spk", "1", "2000433", *span, *options]) == 0
        queries = [asked.query for asked in service.asked]
    assert left(folder) == [
        "1.bsp", "1.bsp.source.json", "2000433.bsp", "2000433.bsp.source.json",
    ]  # fmt: skip
    assert [query["COMMAND"] for query in queries] == ["'1;'", "'DES=2000433;'"]
    assert queries[0]["EPHEM_TYPE"] == "SPK"
    assert queries[0]["START_TIME"] == "'2030-01-01'"
    assert (folder / "1.bsp").read_bytes() == kernel
    assert read_catalogue(folder / "1.bsp").ids.tolist() == [20000001]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"spk": None, "error": "SPK creation is not available\nfor planets"},
            "not available for",
        ),
        ({"spk": None, "result": "API VERSION: 1.2\n***\n No matches found.\n***"}, "No matches"),
        ({"spk": "abc"}, "cut off"),
        ({"spk": base64.b64encode(b"no kernel").decode()}, "something else"),
    ],
)
def test_horizons_says_why_there_is_no_kernel(tmp_path, kernel, change, words):
    target = tmp_path / "1.bsp"
    wanted = {"start": "2030-01-01", "stop": "2031-01-01"}
    with (
        web_service(lambda *_: _kernel_answer(kernel, **change)) as service,
        pytest.raises(InputError, match=words) as error,
    ):
        fetch(horizons_spk("1", target, url=service.url, **wanted), patience=QUICK)
    assert "\n" not in str(error.value)
    assert not target.exists()


def test_half_a_kernel_is_refused(tmp_path, kernel):
    with web_service(lambda *_: _kernel_answer(kernel[:2000])) as service:
        wanted = horizons_spk(
            "Ceres", tmp_path / "c.bsp", start="2030-01-01", stop="2031-01-01", url=service.url
        )
        with pytest.raises(InputError, match="cut off"):
            fetch(wanted, patience=QUICK)
    assert not (tmp_path / "c.bsp").exists()


def test_spans_and_bodies_that_are_none_are_refused(tmp_path):
    with pytest.raises(InputError, match="--start"):
        horizons_spk("1", tmp_path / "c.bsp", start="2031-01-01", stop="2030-01-01")
    with pytest.raises(InputError, match="body"):
        horizons_spk("1;'", tmp_path / "c.bsp", start="2030-01-01", stop="2031-01-01")
