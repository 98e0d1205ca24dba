//! Animations: keyframes of nodes, and where nodes stand at a moment between them.

use std::collections::{BTreeMap, BTreeSet};

use glam::DQuat;
use gltf::json::Root;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::animation::{Channel, Interpolation, Property, Sampler};

use super::accessor::Elements;
use super::buffers::Buffers;
use super::json::{Transform, valid};
use super::nodes::label;

/// All that moves in a file.
pub(super) struct Tracks(Vec<Track>);

/// How one property of a node changes with time.
struct Track {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    /// Seconds, ascending, at least one.
    times: Vec<f64>,
    /// Components of a value.
    width: usize,
    /// The values of all keys; for a cubic spline each between its two tangents.
    values: Vec<f64>,
}

/// Where everything stands at one moment.
pub(super) struct Pose {
    /// Of each node in its parent.
    pub transforms: Vec<Transform>,
    /// Weights of morph targets by node, where they are animated.
    pub weights: BTreeMap<usize, Vec<f32>>,
}

impl Pose {
    /// Without animation.
    pub(super) fn still(transforms: &[Transform]) -> Pose {
        Pose { transforms: transforms.to_vec(), weights: BTreeMap::new() }
    }
}

/// Normalised integers are allowed for rotations and weights.
const FRACTION: &[ComponentType] =
    &[ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];

impl Tracks {
    /// Reads all animations of a file, to be played together from the same moment on. Also returns what the user should know.
    pub(super) fn read(root: &Root, buffers: &Buffers<'_>) -> Result<(Tracks, Vec<String>), String> {
        let (mut tracks, mut warnings, mut known) = (Vec::new(), Vec::new(), BTreeSet::new());
        for (a, animation) in root.animations.iter().enumerate() {
            for (c, channel) in animation.channels.iter().enumerate() {
                let node = channel.target.node.value();
                let place = |e: String| format!("animation {a}, channel {c}: {e}");
                if node >= root.nodes.len() {
                    return Err(place(format!("node {node} does not exist")));
                }
                let Some(property) = valid(&channel.target.path) else {
                    warnings.push(place("what it moves is unknown; it is ignored".to_owned()));
                    continue;
                };
                if property != Property::MorphTargetWeights && root.nodes[node].matrix.is_some() {
                    let node = label(root, node);
                    warnings.push(place(format!("{node} is placed by a matrix and cannot be animated; it stays")));
                    continue;
                }
                if !known.insert((node, property as u8)) {
                    warnings
                        .push("several animations move the same nodes; the first one in the file counts".to_owned());
                    continue;
                }
                let sampler = animation.samplers.get(channel.sampler.value());
                let sampler = sampler.ok_or_else(|| place("its sampler does not exist".to_owned()))?;
                tracks.push(Track::read(root, buffers, channel, property, sampler).map_err(place)?);
            }
        }
        Ok((Tracks(tracks), warnings))
    }

    /// First and last moment of any track, seconds; `None` where nothing is animated.
    pub(super) fn span(&self) -> Option<[f64; 2]> {
        let ends = self.0.iter().filter_map(|track| Some([*track.times.first()?, *track.times.last()?]));
        ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// Moves `transforms`, which are those of the file, to where they are at a moment.
    pub(super) fn pose(&self, transforms: &[Transform], seconds: f64) -> Pose {
        // Keys are in single precision: what is meant to be the moment of a key becomes it.
        let seconds = f64::from(seconds as f32);
        let mut pose = Pose::still(transforms);
        for track in &self.0 {
            let value = track.at(seconds);
            let transform = &mut pose.transforms[track.node];
            match track.property {
                Property::Translation => transform.translation = value[..].try_into().ok(),
                Property::Rotation => transform.rotation = value[..].try_into().ok(),
                Property::Scale => transform.scale = value[..].try_into().ok(),
                Property::MorphTargetWeights => {
                    pose.weights.insert(track.node, value.into_iter().map(|w| w as f32).collect());
                }
            }
        }
        pose
    }
}

impl Track {
    fn read(
        root: &Root,
        buffers: &Buffers<'_>,
        channel: &Channel,
        property: Property,
        sampler: &Sampler,
    ) -> Result<Track, String> {
        let node = channel.target.node.value();
        let interpolation = valid(&sampler.interpolation).ok_or("unknown interpolation")?;
        let times = Elements::new(root, buffers, sampler.input.value())?;
        let times = times.expect("times", &[Type::Scalar], &[ComponentType::F32])?;
        let times: Vec<f64> = (0..times.count).map(|i| f64::from(times.floats::<1>(i)[0])).collect();
        if times.is_empty() || !times.iter().all(|t| t.is_finite()) || times.windows(2).any(|w| w[0] >= w[1]) {
            return Err("times of keys must be finite and ascend, and there must be one".to_owned());
        }
        let (kind, components, width) = match property {
            Property::Translation | Property::Scale => (Type::Vec3, &FRACTION[..1], 3),
            Property::Rotation => (Type::Vec4, FRACTION, 4),
            Property::MorphTargetWeights => (Type::Scalar, FRACTION, 1),
        };
        let output = Elements::new(root, buffers, sampler.output.value())?.expect("values", &[kind], components)?;
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let keys = times.len() * per_key;
        let fits = match property {
            Property::MorphTargetWeights => output.count > 0 && output.count.is_multiple_of(keys),
            _ => output.count == keys,
        };
        if !fits {
            return Err(format!("{} values for {} keys", output.count, times.len()));
        }
        let values: Vec<f64> =
            (0..output.count).flat_map(|i| output.floats::<4>(i).into_iter().take(width)).map(f64::from).collect();
        if !values.iter().all(|v| v.is_finite()) {
            return Err("a value is not finite".to_owned());
        }
        Ok(Track { node, property, interpolation, width: values.len() / keys, times, values })
    }

    /// The value at a moment (specification, appendix C); before the first key and after the last one theirs.
    fn at(&self, seconds: f64) -> Vec<f64> {
        let after = self.times.partition_point(|&t| t <= seconds);
        let last = self.times.len() - 1;
        let [from, to] = [after.saturating_sub(1), after.min(last)];
        let (a, b) = (self.value(from), self.value(to));
        // What stands still keeps its bits.
        let moves = from != to && seconds > self.times[from];
        let length = self.times[to] - self.times[from];
        let t = if moves { (seconds - self.times[from]) / length } else { 0.0 };
        match self.interpolation {
            _ if !moves => a.to_vec(),
            Interpolation::Step => a.to_vec(),
            Interpolation::Linear if a == b => a.to_vec(),
            Interpolation::Linear if self.property == Property::Rotation => slerp(a, b, t),
            Interpolation::Linear => a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect(),
            Interpolation::CubicSpline => {
                let (leaving, arriving) = (self.tangent(from, 2), self.tangent(to, 0));
                if a == b && leaving.iter().chain(arriving).all(|&slope| slope == 0.0) {
                    return a.to_vec();
                }
                let (t2, t3) = (t * t, t * t * t);
                let weights =
                    [2.0 * t3 - 3.0 * t2 + 1.0, length * (t3 - 2.0 * t2 + t), 3.0 * t2 - 2.0 * t3, length * (t3 - t2)];
                let sum = |i: usize| {
                    weights[0] * a[i] + weights[1] * leaving[i] + weights[2] * b[i] + weights[3] * arriving[i]
                };
                (0..self.width).map(sum).collect()
            }
        }
    }

    fn value(&self, key: usize) -> &[f64] {
        match self.interpolation {
            Interpolation::CubicSpline => self.tangent(key, 1),
            _ => &self.values[key * self.width..][..self.width],
        }
    }

    /// Of a cubic spline's key: the tangent at which it is reached (0), its value (1), the tangent at which it is left (2).
    fn tangent(&self, key: usize, which: usize) -> &[f64] {
        &self.values[(3 * key + which) * self.width..][..self.width]
    }
}

/// Along the shorter way on the sphere of quaternions, whatever their lengths.
fn slerp(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    let unit = |q: &[f64]| DQuat::from_slice(q).normalize();
    let between = unit(a).slerp(unit(b), t);
    // One of them has no length: the nearest key, which says so when it is used.
    if between.is_finite() { between.to_array().to_vec() } else { a.to_vec() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(property: Property, interpolation: Interpolation, width: usize, times: &[f64], values: &[f64]) -> Track {
        Track { node: 0, property, interpolation, times: times.to_vec(), width, values: values.to_vec() }
    }

    #[test]
    fn lines_and_steps() {
        let along = |interpolation| track(Property::Scale, interpolation, 1, &[1.0, 2.0, 4.0], &[10.0, 20.0, 60.0]);
        let line = along(Interpolation::Linear);
        for (seconds, value) in
            [(0.0, 10.0), (1.0, 10.0), (1.25, 12.5), (2.0, 20.0), (3.0, 40.0), (4.0, 60.0), (9.0, 60.0)]
        {
            assert_eq!(line.at(seconds), [value], "at {seconds}");
        }
        let steps = along(Interpolation::Step);
        for (seconds, value) in [(0.0, 10.0), (1.99, 10.0), (2.0, 20.0), (3.99, 20.0), (4.0, 60.0)] {
            assert_eq!(steps.at(seconds), [value], "at {seconds}");
        }
    }

    /// Hermite splines give cubic polynomials exactly.
    #[test]
    fn a_cubic_is_its_own_spline() {
        let (f, slope) = (|t: f64| t * t * t - 2.0 * t + 1.0, |t: f64| 3.0 * t * t - 2.0);
        let times = [0.5, 1.0, 3.0];
        let values: Vec<f64> = times.iter().flat_map(|&t| [slope(t), f(t), slope(t)]).collect();
        let spline = track(Property::Scale, Interpolation::CubicSpline, 1, &times, &values);
        for i in 0..=50 {
            let t = 0.5 + 2.5 * f64::from(i) / 50.0;
            assert!((spline.at(t)[0] - f(t)).abs() < 1e-13, "at {t}");
        }
    }

    #[test]
    fn rotations_take_the_shorter_way_at_constant_speed() {
        let turn = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians());
        // The second key is written as its negative, which is the same rotation.
        let values = [turn(10.0).to_array(), (-turn(100.0)).to_array()].concat();
        let track = track(Property::Rotation, Interpolation::Linear, 4, &[0.0, 1.0], &values);
        for i in 0..=9 {
            let found = DQuat::from_slice(&track.at(f64::from(i) / 9.0));
            let expected = turn(10.0 + 10.0 * f64::from(i));
            assert!((found.dot(expected).abs() - 1.0).abs() < 1e-14, "step {i}");
        }
    }

    #[test]
    fn what_stands_still_keeps_its_bits() {
        let q = [0.1, 0.2, 0.3, 0.9];
        let times = [0.0, 1.0];
        let line = track(Property::Rotation, Interpolation::Linear, 4, &times, &[q, q].concat());
        let spline_values = [[0.0; 4], q, [0.0; 4], [0.0; 4], q, [0.0; 4]].concat();
        let spline = track(Property::Rotation, Interpolation::CubicSpline, 4, &times, &spline_values);
        for i in 0..=7 {
            assert_eq!(line.at(f64::from(i) / 7.0), q);
            assert_eq!(spline.at(f64::from(i) / 7.0), q);
        }
    }
}
