//! Circles in a graph of imports.

use std::collections::{BTreeMap, BTreeSet};

/// Sets of nodes that all reach one another, of two nodes or more: the strongly connected components.
pub fn circles<'a>(graph: &BTreeMap<&'a str, BTreeSet<&'a str>>) -> Vec<BTreeSet<&'a str>> {
    let reached: BTreeMap<&str, BTreeSet<&str>> = graph.keys().map(|&node| (node, reachable(graph, node))).collect();

    let mut found: Vec<BTreeSet<&str>> = Vec::new();
    for (&node, others) in &reached {
        if found.iter().any(|circle| circle.contains(node)) {
            continue;
        }
        let back = others.iter().filter(|&&other| reached.get(other).is_some_and(|there| there.contains(node)));
        let circle: BTreeSet<&str> = back.copied().chain([node]).collect();
        if circle.len() > 1 {
            found.push(circle);
        }
    }

    found
}

fn reachable<'a>(graph: &BTreeMap<&'a str, BTreeSet<&'a str>>, start: &str) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut open: Vec<&str> = vec![start];
    while let Some(node) = open.pop() {
        for &next in graph.get(node).into_iter().flatten() {
            if reached.insert(next) {
                open.push(next);
            }
        }
    }

    reached
}

#[test]
fn two_circles_with_a_bridge_are_two() {
    let graph = BTreeMap::from([
        ("a", BTreeSet::from(["b"])),
        ("b", BTreeSet::from(["a", "c"])),
        ("c", BTreeSet::from(["d"])),
        ("d", BTreeSet::from(["c", "e"])),
    ]);
    assert_eq!(circles(&graph), [BTreeSet::from(["a", "b"]), BTreeSet::from(["c", "d"])]);
}
