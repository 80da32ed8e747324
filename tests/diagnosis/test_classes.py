"""Causes that a campaign cannot tell apart are one class, where that holds for every two of them."""

from labsim.diagnosis.screen import group_classes


def test_no_pair_no_class():
    assert group_classes([]) == []


def test_every_two_of_a_class_are_confusable():
    pairs = [("a", "b", 0.95), ("b", "c", -0.97), ("a", "c", 0.92), ("d", "e", 0.99)]
    assert group_classes(pairs) == [["a", "b", "c"], ["d", "e"]]


def test_a_chain_of_neighbours_is_not_one_class():
    """a and c are told apart: the nearer of b's neighbours stays with it."""
    assert group_classes([("a", "b", 0.93), ("b", "c", 0.98)]) == [["b", "c"]]


def test_the_order_of_the_pairs_does_not_matter():
    pairs = [("a", "b", 0.95), ("b", "c", -0.97), ("a", "c", 0.92), ("d", "e", 0.99)]
    assert group_classes(pairs[::-1]) == group_classes(pairs)
