//! How a file keeps its sequences, which may be of unequal length.

use super::arrays::{
    ArrayFile, ArrayInfo, ENDS, FRAMES, Kind, Members, POINTS, Values, check_frames, find, listed,
};
use super::names::natural_order;
use super::reading::AxisOrder;
use crate::error::{Error, Reason, Result};

/// robomimic's group of episodes, and how each of them is called.
const DEMOS: (&str, &str) = ("data", "demo_");
/// In an episode of robomimic, what was observed.
const OBSERVED: &str = "obs";
/// Where each episode ends in arrays that hold one after the other: in a file of arrays, and in a
/// replay buffer of diffusion policy with the group of its arrays.
const ENDS_OF: [(&str, &str); 2] = [(ENDS, ""), ("meta/episode_ends", "data")];

/// How a file keeps its sequences.
pub(super) enum Sequences {
    /// As an axis of every array, or without one where there is a single sequence.
    Axis,
    /// In groups of their own, as robomimic's `data/demo_0`.
    Groups(Vec<Episode>),
    /// One after the other in the arrays of a group, as in diffusion policy's replay buffers.
    Ends {
        /// Empty for the file itself.
        group: &'static str,
        /// The number of frames of every sequence.
        lengths: Vec<usize>,
    },
}

/// A sequence with a group of its own.
pub(super) struct Episode {
    /// What the group is called.
    pub name: String,
    /// Its path.
    pub path: String,
}

impl Episode {
    /// The groups in which its arrays may lie, as files of their own.
    pub fn places<'a>(&self, file: &'a dyn ArrayFile) -> [Within<'a>; 2] {
        [join(&self.path, OBSERVED), self.path.clone()].map(|group| Within { file, group })
    }

    /// The group that holds its points, if any.
    pub fn points<'a>(&self, file: &'a dyn ArrayFile) -> Result<Option<Within<'a>>> {
        for place in self.places(file) {
            if find(&place, &POINTS)?.is_some() {
                return Ok(Some(place));
            }
        }
        Ok(None)
    }
}

impl Sequences {
    /// How a file keeps them, by the names of its arrays and groups.
    ///
    /// # Errors
    /// When the file does not say where its episodes end in ascending numbers.
    pub fn of(file: &dyn ArrayFile) -> Result<Self> {
        for (name, group) in ENDS_OF {
            if let Some(info) = file.info(name)? {
                let lengths = lengths(file, name, &info).map_err(|e| e.at(format!("`{name}`")))?;
                return Ok(Self::Ends { group, lengths });
            }
        }
        let (data, prefix) = DEMOS;
        let mut names = file.members(data)?.groups;
        names.retain(|name| name.starts_with(prefix));
        if names.is_empty() {
            return Ok(Self::Axis);
        }
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let episode = |i: usize| Episode {
            path: join(data, names[i]),
            name: names[i].to_owned(),
        };
        let order = natural_order(&names).into_iter();
        Ok(Self::Groups(order.map(episode).collect()))
    }

    /// Whether every sequence has arrays of its own, or shares them without an axis of sequences.
    pub fn have_one_each(&self) -> bool {
        !matches!(self, Self::Axis)
    }

    /// Whether the arrays are those of a replay buffer of diffusion policy.
    pub fn is_replay(&self) -> bool {
        matches!(self, Self::Ends { group, .. } if !group.is_empty())
    }

    /// The names of the arrays that a sequence has, of those with a group in the first one.
    pub fn names(&self, file: &dyn ArrayFile) -> Result<Vec<String>> {
        match self {
            Self::Axis => file.names(),
            Self::Ends { group, .. } => {
                let group = (*group).to_owned();
                Within { file, group }.names()
            }
            Self::Groups(episodes) => {
                let [observed, own] = episodes[0].places(file);
                let observed = observed
                    .names()?
                    .into_iter()
                    .map(|name| join(OBSERVED, &name));
                Ok(observed.chain(own.names()?).collect())
            }
        }
    }

    /// The paths of the arrays of frames: one, or one of each group. `array` names it, where a
    /// person said which.
    ///
    /// # Errors
    /// When there is none, or several and nobody said which.
    pub fn frames(
        &self,
        file: &dyn ArrayFile,
        array: Option<&str>,
    ) -> Result<Vec<(String, ArrayInfo)>> {
        match (self, array) {
            (Self::Groups(episodes), _) => {
                let of_episode = |episode: &Episode| {
                    let found = camera(&episode.places(file), array);
                    found.map_err(|e| e.at(format!("`{}`", episode.path)))
                };
                episodes.iter().map(of_episode).collect()
            }
            (Self::Ends { group, .. }, _) if self.is_replay() => {
                let group = (*group).to_owned();
                Ok(vec![camera(&[Within { file, group }], array)?])
            }
            (_, Some(name)) => {
                let info = file.info(name)?.ok_or_else(|| {
                    no_frames(&format!("there is no array `{name}`"), &file.names())
                })?;
                Ok(vec![(name.to_owned(), info)])
            }
            (_, None) => {
                let (name, info) = find(file, &FRAMES)?.ok_or_else(|| {
                    no_frames(
                        "no array of frames; expected `images` or `frames`",
                        &file.names(),
                    )
                })?;
                Ok(vec![(name.to_owned(), info)])
            }
        }
    }
}

fn no_frames(what: &str, names: &Result<Vec<String>>) -> Error {
    let names = names.as_ref().map_or(&[][..], Vec::as_slice);
    Error::input(format!("{what}, found {}", listed(names))).because(Reason::NoFrames)
}

/// The array of frames in the first of `places` that has any: the one that is asked for, or the
/// only one that looks like a camera's.
fn camera(places: &[Within], array: Option<&str>) -> Result<(String, ArrayInfo)> {
    let mut others = Vec::new();
    for place in places {
        if let Some(name) = array {
            if let Some(info) = place.info(name)? {
                return Ok((place.path(name), info));
            }
            others.extend(place.names()?);
            continue;
        }
        let mut cameras = Vec::new();
        for name in place.names()? {
            match place.info(&name)? {
                Some(info) if looks_like_frames(&info) => cameras.push((name, info)),
                _ => others.push(name),
            }
        }
        match &cameras[..] {
            [] => {}
            [(name, _)] => {
                let path = place.path(name);
                return Ok((path, cameras.remove(0).1));
            }
            _ => {
                let names: Vec<String> = cameras.into_iter().map(|(name, _)| name).collect();
                return Err(Error::input(format!(
                    "there are frames of several cameras: {}; expected one of them to be chosen",
                    listed(&names)
                ))
                .because(Reason::SeveralCameras { names }));
            }
        }
    }
    let what = match array {
        Some(name) => format!("there is no array `{name}`"),
        None => "no array of frames; expected one of shape [T, H, W, 3]".to_owned(),
    };
    Err(no_frames(&what, &Ok(others)))
}

/// Whether an array can be the frames of one camera.
fn looks_like_frames(info: &ArrayInfo) -> bool {
    let has_channels = matches!(info.shape[..], [_, _, _, 3] | [_, 3, _, _]);
    has_channels && info.kind.is_some_and(Kind::holds_frames)
}

/// The lengths of sequences from the numbers of the frames behind their last ones.
fn lengths(file: &dyn ArrayFile, name: &str, info: &ArrayInfo) -> Result<Vec<usize>> {
    let wrong = || {
        Error::input(format!(
            "{}, shape {:?}; expected for each episode the number of the frame behind its last, \
             ascending",
            info.dtype, info.shape
        ))
    };
    if info.kind.is_none() || info.shape.len() != 1 {
        return Err(wrong());
    }
    let ends: Vec<f64> = match file.read(name, &[])? {
        Values::F64(ends) => ends,
        Values::F32(ends) => ends.into_iter().map(f64::from).collect(),
        Values::U8(ends) => ends.into_iter().map(f64::from).collect(),
    };
    let mut before = 0.0;
    let mut lengths = Vec::with_capacity(ends.len());
    for end in ends {
        // Exact: both are whole, and far below 2^53.
        if !(end > before && end.fract() == 0.0 && end < f64::from(u32::MAX)) {
            return Err(wrong());
        }
        lengths.push((end - before) as usize);
        before = end;
    }
    check_frames(1, before as usize, name, &info.shape)?;
    match lengths.is_empty() {
        true => Err(wrong()),
        false => Ok(lengths),
    }
}

/// A path of `name` in a group; the file itself is the group without a name.
fn join(group: &str, name: &str) -> String {
    match group {
        "" => name.to_owned(),
        _ => format!("{group}/{name}"),
    }
}

/// The arrays of a group as a file of their own.
pub(super) struct Within<'a> {
    pub file: &'a dyn ArrayFile,
    pub group: String,
}

impl Within<'_> {
    fn path(&self, name: &str) -> String {
        join(&self.group, name)
    }
}

impl ArrayFile for Within<'_> {
    fn names(&self) -> Result<Vec<String>> {
        match self.group.as_str() {
            "" => self.file.names(),
            group => Ok(self.file.members(group)?.arrays),
        }
    }

    fn members(&self, group: &str) -> Result<Members> {
        self.file.members(&self.path(group))
    }

    fn info(&self, name: &str) -> Result<Option<ArrayInfo>> {
        self.file.info(&self.path(name))
    }

    fn read(&self, name: &str, leading: &[u64]) -> Result<Values> {
        self.file.read(&self.path(name), leading)
    }

    fn size(&self) -> Option<u64> {
        self.file.size()
    }

    fn axes(&self) -> Option<AxisOrder> {
        self.file.axes()
    }

    fn strings(&self, name: &str) -> Result<Vec<String>> {
        self.file.strings(&self.path(name))
    }

    fn left_out(&self) -> &[String] {
        self.file.left_out()
    }

    fn point_names(&self) -> Result<Option<Vec<String>>> {
        match self.info("names")? {
            Some(_) => self.strings("names").map(Some),
            None => self.file.point_names(),
        }
    }
}
