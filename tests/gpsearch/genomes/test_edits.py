"""What single edits do, and that they keep their meaning wherever crossover puts them."""

import pytest

from fitters.expressions import parse, to_text
from gpsearch.genomes import Delete, Edit, Genome, Insert, Replace, Swap, crossover, reify
from gpsearch.genomes.genome import draft

PHONG = "pow(max(dot(wr, wo), 0), p0)"


def labels(text: str, edits: tuple[Edit, ...] = ()) -> dict[str, str]:
    """Labels by the text of their subexpression, for texts that occur once."""
    made = draft(Genome(text, edits))
    return {to_text(made.expression(label)): label for label in made.symbols}


def edited(text: str, *edits: Edit) -> str:
    return to_text(reify(Genome(text, edits)))


AT = labels(PHONG)


def test_a_genome_without_edits_is_its_start():
    assert edited(PHONG) == PHONG


def test_a_start_is_labelled_in_preorder():
    numbers = [label.split(".")[1] for label in draft(Genome(PHONG)).symbols]
    assert numbers == [str(i) for i in range(parse(PHONG).nodes)]


def test_swap_exchanges_two_nodes():
    assert edited(PHONG, Swap(AT["dot(wr, wo)"], AT["p0"])) == "pow(max(p0, 0), dot(wr, wo))"


def test_swap_exchanges_the_children_of_one_parent():
    assert edited("p0 - p1", Swap(labels("p0 - p1")["p0"], labels("p0 - p1")["p1"])) == "p1 - p0"


@pytest.mark.parametrize("pair", [("dot(wr, wo)", "p0"), ("max(dot(wr, wo), 0)", "p0"), ("0", "p0")])
def test_swap_is_its_own_inverse(pair):
    swap = Swap(AT[pair[0]], AT[pair[1]])
    assert edited(PHONG, swap) != PHONG
    assert edited(PHONG, swap, swap) == PHONG
    assert edited(PHONG, swap, Swap(swap.second, swap.first)) == PHONG


@pytest.mark.parametrize("inner", ["dot(wr, wo)", "max(dot(wr, wo), 0)", PHONG])
def test_a_node_is_not_swapped_with_one_inside_it(inner):
    outer = AT["max(dot(wr, wo), 0)"] if inner != PHONG else AT[PHONG]
    assert edited(PHONG, Swap(outer, AT[inner])) == PHONG
    assert edited(PHONG, Swap(AT[inner], outer)) == PHONG


def test_vectors_are_not_swapped_with_numbers():
    assert edited(PHONG, Swap(AT["wr"], AT["p0"])) == PHONG
    assert edited(PHONG, Delete(AT["wo"], "new")) == PHONG
    assert edited(PHONG, Insert(AT["wo"], "p0", "new")) == PHONG


def test_insert_takes_the_place_of_a_node_and_all_below_it():
    assert edited(PHONG, Insert(AT["max(dot(wr, wo), 0)"], "1 - wh.z", "new")) == "pow(1 - wh.z, p0)"
    assert edited(PHONG, Insert(AT[PHONG], "p0 / pi", "new")) == "p0 / pi"


def test_replace_leaves_the_children_untouched():
    assert edited(PHONG, Replace(AT["max(dot(wr, wo), 0)"], "mul")) == "pow(dot(wr, wo) * 0, p0)"
    assert edited(PHONG, Replace(AT["wo"], "wh")) == "pow(max(dot(wr, wh), 0), p0)"
    assert edited(PHONG, Replace(AT["0"], "wh.z")) == "pow(max(dot(wr, wo), wh.z), p0)"


@pytest.mark.parametrize(
    ("node", "symbol"), [("p0", "sin"), ("0", "wh"), ("wr", "1"), (PHONG, "exp"), (PHONG, "2")]
)
def test_replace_keeps_to_the_nodes_sort(node, symbol):
    assert edited(PHONG, Replace(AT[node], symbol)) == PHONG


def test_delete_leaves_the_constant_1():
    assert edited(PHONG, Delete(AT["dot(wr, wo)"], "new")) == "pow(max(1, 0), p0)"
    assert edited(PHONG, Delete(AT[PHONG], "new")) == "1"


def test_what_an_edit_brought_can_be_edited():
    bring = Insert(AT["0"], "1 - p0", "3f2a90c1d4e5")
    assert edited(PHONG, bring, Replace("3f2a90c1d4e5.1", "pi")) == "pow(max(dot(wr, wo), pi - p0), p0)"
    assert edited(PHONG, bring, Delete("3f2a90c1d4e5.0", "b")) == "pow(max(dot(wr, wo), 1), p0)"
    assert edited(PHONG, Delete(AT["0"], "a"), Replace("a.0", "4")) == "pow(max(dot(wr, wo), 4), p0)"


def test_an_edit_whose_node_is_gone_does_nothing_and_acts_again_once_it_is_back():
    bring, change = Insert(AT["0"], "1 - p0", "a"), Replace("a.1", "2")
    remove = Delete(AT["max(dot(wr, wo), 0)"], "b")
    assert edited(PHONG, bring, change) == "pow(max(dot(wr, wo), 2 - p0), p0)"
    assert edited(PHONG, remove, change) == edited(PHONG, remove) == "pow(1, p0)"
    assert edited(PHONG, change, bring) == edited(PHONG, bring)
    with_node, without = Genome(PHONG, (bring, bring)), Genome(PHONG, (remove, change))
    back, _ = crossover(with_node, without, 1)
    assert back.edits == (bring, change)
    assert to_text(reify(back)) == "pow(max(dot(wr, wo), 2 - p0), p0)"


def test_a_label_names_the_same_node_after_swaps_have_carried_it_away():
    swaps = (
        Swap(AT["dot(wr, wo)"], AT["p0"]),
        Swap(AT["max(dot(wr, wo), 0)"], AT["dot(wr, wo)"]),
        Swap(AT["0"], AT["dot(wr, wo)"]),
    )
    assert edited(PHONG, *swaps) == "pow(0, max(p0, dot(wr, wo)))"
    after = labels(PHONG, swaps)
    assert {text: after[text] for text in ("wr", "wo", "p0", "0", "dot(wr, wo)")} == {
        text: AT[text] for text in ("wr", "wo", "p0", "0", "dot(wr, wo)")
    }
    assert edited(PHONG, *swaps, Replace(AT["wo"], "wh")) == "pow(0, max(p0, dot(wr, wh)))"


def test_replacing_v_by_h_keeps_its_meaning_behind_other_edits():
    """Section 3.1 of the genBRDF paper: edit 1 multiplies by n, edit 2 replaces V by H, a later one R by N.

    Traced by hand: the second edit moves behind a genome that has turned the formula round.
    """
    scale = Insert(AT["0"], "p0 * 0", "a")
    v_by_h, r_by_n = Replace(AT["wo"], "wh"), Replace(AT["wr"], "wn")
    turned = Swap(AT["max(dot(wr, wo), 0)"], AT["p0"])
    papers, other = Genome(PHONG, (scale, v_by_h)), Genome(PHONG, (turned, r_by_n))
    assert to_text(reify(papers)) == "pow(max(dot(wr, wh), p0 * 0), p0)"
    assert to_text(reify(other)) == "pow(p0, max(dot(wn, wo), 0))"
    first, second = crossover(papers, other, 1)
    assert to_text(reify(first)) == "pow(max(dot(wn, wo), p0 * 0), p0)"
    assert to_text(reify(second)) == "pow(p0, max(dot(wr, wh), 0))"
    blinn_phong = Genome(PHONG, (v_by_h, r_by_n))
    assert to_text(reify(blinn_phong)) == "pow(max(dot(wn, wh), 0), p0)"


def test_edits_of_another_start_do_nothing():
    assert edited("p0 / pi", Delete(AT["p0"], "a"), Replace(AT["wo"], "wh")) == "p0 / pi"
