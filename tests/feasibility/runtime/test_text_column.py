"""`TextColumn` behaves as a tuple of texts and takes little room."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility.runtime.text_column import TextColumn, taken_texts

TEXTS = st.lists(st.text(st.characters(exclude_categories=["Cs"]), max_size=8), max_size=12)


@given(TEXTS)
def test_a_column_is_what_a_tuple_of_its_texts_is(texts):
    column, plain = TextColumn.of(texts), tuple(texts)
    assert column == plain
    assert column == TextColumn.of(texts)
    assert list(column) == texts
    assert len(column) == len(plain)
    assert [column[k] for k in range(-len(plain), len(plain))] == [*plain, *plain]
    assert column[1:5:2] == plain[1:5:2]
    assert hash(column) == hash(plain)
    assert pickle.loads(pickle.dumps(column)) == plain
    for text in texts:
        assert column.index(text) == plain.index(text)
        assert text in column
    rows = np.arange(len(plain))[::-1]
    assert column.take(rows) == plain[::-1] == taken_texts(plain, rows)
    assert TextColumn.concatenate([column, column]) == plain + plain


def test_what_is_not_there():
    column = TextColumn.of(["a", "b"])
    assert column != ("a",)
    assert column != ["a", "b"]
    with pytest.raises(IndexError):
        column[2]
    assert repr(column) == "TextColumn(n=2: 'a', 'b')"


def test_a_hundred_thousand_names_take_two_megabytes():
    column = TextColumn.of(f"1999 AB{k}" for k in range(100_000))
    assert len(pickle.dumps(column)) < 2.1e6
