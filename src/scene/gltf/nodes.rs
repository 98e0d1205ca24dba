//! The node hierarchy.

use glam::DAffine3;
use gltf::json::Root;

use super::json::{Document, Transform};

/// World transforms of the nodes that are part of the scene.
pub(super) struct Nodes {
    /// Nodes of the scene, parents before children, in the file's order.
    pub visited: Vec<usize>,
    /// World transform of every node of the file, whether in the scene or not (joints need not be).
    pub world: Vec<DAffine3>,
    /// What the user should know.
    pub warning: Option<String>,
}

impl Nodes {
    /// Walks the default scene, else the first one, else all root nodes. `transforms` say where each node stands in its parent.
    pub(super) fn walk(document: &Document, transforms: &[Transform]) -> Result<Nodes, String> {
        let root = &document.root;
        let local = transforms.iter().enumerate().map(|(i, t)| t.affine().map_err(|e| format!("node {i}: {e}")));
        let local = local.collect::<Result<Vec<_>, _>>()?;
        let parents = parents(root)?;
        let mut world = vec![None; root.nodes.len()];
        for start in 0..root.nodes.len() {
            // Iterative: a chain of a million nodes must not overflow the stack.
            let mut chain = vec![start];
            while let Some(parent) = chain.last().and_then(|&n| parents[n]).filter(|&p| world[p].is_none()) {
                if chain.len() > root.nodes.len() {
                    return Err(format!("node {start} is its own descendant"));
                }
                chain.push(parent);
            }
            while let Some(node) = chain.pop() {
                if world[node].is_none() {
                    let above = parents[node].and_then(|p| world[p]).unwrap_or(DAffine3::IDENTITY);
                    world[node] = Some(above * local[node]);
                }
            }
        }
        let scene = root.scene.as_ref().map(|s| s.value()).or((!root.scenes.is_empty()).then_some(0));
        let (roots, warning): (Vec<usize>, _) = match scene.map(|s| (s, root.scenes.get(s))) {
            Some((_, Some(scene))) => (scene.nodes.iter().map(|n| n.value()).collect(), None),
            Some((s, None)) => return Err(format!("the default scene {s} does not exist")),
            None => {
                let roots = (0..root.nodes.len()).filter(|&n| parents[n].is_none()).collect();
                (roots, Some("the file has no scene; all its nodes are used".to_string()))
            }
        };
        let mut seen = vec![false; root.nodes.len()];
        let mut visited = Vec::new();
        let mut stack: Vec<usize> = roots.into_iter().rev().collect();
        while let Some(node) = stack.pop() {
            if std::mem::replace(&mut seen[node], true) {
                return Err(format!("node {node} is in the scene twice"));
            }
            visited.push(node);
            stack.extend(root.nodes[node].children.iter().flatten().rev().map(|c| c.value()));
        }
        let world = world.into_iter().map(|w| w.unwrap_or(DAffine3::IDENTITY)).collect();
        Ok(Nodes { visited, world, warning })
    }
}

fn parents(root: &Root) -> Result<Vec<Option<usize>>, String> {
    let mut parents = vec![None; root.nodes.len()];
    for (n, node) in root.nodes.iter().enumerate() {
        for child in node.children.iter().flatten().map(|c| c.value()) {
            if child == n {
                return Err(format!("node {n} is its own child"));
            }
            if let Some(first) = parents[child].replace(n) {
                return Err(format!("node {child} has several parents ({first} and {n}); glTF allows only one"));
            }
        }
    }
    Ok(parents)
}

/// How messages name a node.
pub(super) fn label(root: &Root, node: usize) -> String {
    match &root.nodes[node].name {
        Some(name) => format!("node {node} '{name}'"),
        None => format!("node {node}"),
    }
}
