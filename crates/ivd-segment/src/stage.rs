//! The stage as scenes and commands see it.

use ivd_core::op::{Failure, Job, Memory, Method, Op, Place, PlaceKind, Remark, Stage, Want, method};
use ivd_core::{Exec, Labels, Mask, ParamError, Tree, Volume, Voxels, slots};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::figures::MOST_LEAVES;
use crate::hvs::{classes as classes_of_tree, drawn};
use crate::{
    ChainParams, CutFigures, CutParams, EmvsParams, Error, Figures, HvsParams, KmvsParams, MixtureFigures,
    ModesFigures, MsvsParams, NoFigures, ProposalFigures, Segmentation, SpatialFigures, ThresholdParams,
    TidyParams, TreeFigures, emvs, emvs_with_posteriors, kmvs, kmvs_spatial, msvs, msvs_kmvs, region_tree,
    threshold, tidy,
};

/// The stage: its methods, and where it stands in a scene.
pub const STAGE: Stage = Stage {
    name: "segment",
    about: "Finds a volume's classes.",
    selector: "method",
    methods: METHODS,
    positional: &["volume"],
    places: &[
        Place {
            variant: "tree",
            kind: PlaceKind::Precursor { method: &TREE },
            unread: "the classes come from no tree",
            ..Place::only("tree")
        },
        Place { unread: "the isovalue is given and no class is named", ..Place::only("labels") },
    ],
    quiet: false,
    memory: Memory { voxel: 12, reached: 0, triangle: 0 },
};
const METHODS: &[Method] = &[
    method::<Tidied<KmvsParams>>("kmvs"),
    method::<Tidied<EmvsParams>>("emvs"),
    method::<Tidied<MsvsParams>>("msvs"),
    method::<Hierarchy>("hvs"),
    method::<Tidied<ChainParams>>("msvs+kmvs"),
    method::<Tidied<ThresholdParams>>("threshold"),
];
/// The tree that [`Hierarchy`] cuts.
const TREE: Method = method::<HvsParams>("hvs");

slots! {
    /// What classes are found in.
    pub struct Scanned<'a> { volume: &'a Volume, mask: Option<&'a Mask> }
}
slots! {
    /// What is cut: a tree that is there, or that of a volume.
    pub struct Grown<'a> { tree: Option<&'a Tree>, volume: Option<&'a Volume>, mask: Option<&'a Mask> }
}

/// The classes, and what the method alone tells.
type Found<O> = Result<(Segmentation, O), Error>;

/// A way to find classes in a volume.
pub trait Find: Serialize + DeserializeOwned + JsonSchema + Default + Clone + Send + Sync + 'static {
    /// What it tells beside the figures that all have.
    type Own: Serialize + DeserializeOwned + JsonSchema + Send;

    /// What a person should know beside the figures: see [`Op::REMARK`].
    fn remark(own: &Self::Own) -> Option<String> {
        let _ = own;
        None
    }

    /// As [`Op::check_together`].
    ///
    /// # Errors
    /// Names the field as it is typed.
    fn check_found(&self) -> Result<(), ParamError>;

    /// Finds them.
    ///
    /// # Errors
    /// Those of the method's function.
    fn find(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Found<Self::Own>;
}

// A method's description is that of its own parameters, not of what is shared.
#[allow(missing_docs, reason = "a doc here would stand in the place of the method's own in schema and help")]
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, bound(deserialize = "M: Find"))]
#[schemars(bound = "M: Find")]
pub struct Tidied<M> {
    /// How classes are found.
    #[serde(flatten)]
    pub method: M,
    /// What is done with them then.
    #[serde(flatten)]
    pub tidy: TidyParams,
}

/// Raised for all methods together: what they share is most of them.
const REVISION: u32 = 7;

impl<M: Find> Op for Tidied<M> {
    const REVISION: u32 = REVISION;
    const REMARK: Option<Remark<Figures<M::Own>>> = Some(|figures| M::remark(&figures.own));
    type Inputs<'a> = Scanned<'a>;
    type Gives = (Labels, Figures<M::Own>);

    fn check_together(&self) -> Result<(), ParamError> {
        self.method.check_found()
    }

    fn run(&self, inputs: Scanned<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let (found, own) = self.method.find(inputs.volume, inputs.mask, exec)?;
        Ok(told(tidied(Some(inputs.volume), found, self.tidy, exec)?, own))
    }
}

impl Tidied<EmvsParams> {
    /// As [`Op::run`], with the posterior probability of every component of the mixture as a volume.
    ///
    /// # Errors
    /// As [`Op::run`].
    #[allow(clippy::type_complexity, reason = "what run gives, and the maps")]
    pub fn run_with_posteriors(
        &self,
        inputs: Scanned<'_>,
        exec: &Exec,
    ) -> Result<(Labels, Figures<MixtureFigures>, Vec<Volume>), Failure> {
        let Scanned { volume, mask } = inputs;
        let (found, maps) = emvs_with_posteriors(volume, mask, &self.method, exec)?;
        let own = MixtureFigures::of(&found, &self.method);
        let (labels, figures) = told(tidied(Some(volume), found.segmentation, self.tidy, exec)?, own);
        let maps = maps.into_iter().map(|map| Volume::new(volume.grid().clone(), Voxels::F32(map)));
        Ok((labels, figures, maps.collect::<Result<_, _>>()?))
    }
}

/// Labels as they are wanted.
fn tidied(
    volume: Option<&Volume>,
    found: Segmentation,
    params: TidyParams,
    exec: &Exec,
) -> Result<Segmentation, Failure> {
    if !params.is_any() {
        return Ok(found);
    }
    let volume = volume.ok_or_else(|| {
        Failure::usage(
            "smallest and order look at the voxels' values, and a tree has none; segment the volume instead",
        )
    })?;
    Ok(tidy(volume, found, params, exec)?)
}

fn told<O>(found: Segmentation, own: O) -> (Labels, Figures<O>) {
    let figures = Figures::of(&found, own);
    (found.labels, figures)
}

impl Find for KmvsParams {
    type Own = SpatialFigures;

    fn check_found(&self) -> Result<(), ParamError> {
        self.check_read()?;
        self.check_together()
    }

    fn find(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Found<SpatialFigures> {
        if self.spatial_weight == 0.0 {
            return Ok((kmvs(volume, mask, self, exec)?, SpatialFigures::default()));
        }
        let found = kmvs_spatial(volume, mask, self, exec)?;
        let own = SpatialFigures::from(&found);
        Ok((found.segmentation, own))
    }
}

impl Find for EmvsParams {
    type Own = MixtureFigures;

    fn remark(own: &MixtureFigures) -> Option<String> {
        let at_limit = own.at_limit.then(|| {
            "k = auto stopped at its limit, k_max, where the criterion still fell: values that are no mixture of normal distributions \
             have no best number; name k, or raise k_max"
                .to_owned()
        });
        let around = own.mixture.around().map(|[outer, inner]| {
            format!(
                "the class about {outer:.4} has values on both sides of that about {inner:.4}, whose density is so much narrower: no isovalue \
                 parts them; kmvs keeps classes apart"
            )
        });
        at_limit.into_iter().chain(around).reduce(|all, next| format!("{all}; {next}"))
    }

    fn check_found(&self) -> Result<(), ParamError> {
        self.check_together()
    }

    fn find(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Found<MixtureFigures> {
        let found = emvs(volume, mask, self, exec)?;
        let own = MixtureFigures::of(&found, self);
        Ok((found.segmentation, own))
    }
}

impl Find for MsvsParams {
    type Own = ModesFigures;

    fn check_found(&self) -> Result<(), ParamError> {
        self.within.check()
    }

    fn find(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Found<ModesFigures> {
        let found = msvs(volume, mask, self, exec)?;
        let own = ModesFigures::from(&found);
        Ok((found.segmentation, own))
    }
}

impl Find for ChainParams {
    type Own = ProposalFigures;

    fn check_found(&self) -> Result<(), ParamError> {
        self.msvs.within.check()
    }

    fn find(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Found<ProposalFigures> {
        let found = msvs_kmvs(volume, mask, self, exec)?;
        let own = ProposalFigures::from(&found);
        Ok((found.segmentation, own))
    }
}

impl Find for ThresholdParams {
    type Own = NoFigures;

    fn check_found(&self) -> Result<(), ParamError> {
        self.check_together()
    }

    fn find(&self, volume: &Volume, mask: Option<&Mask>, exec: &Exec) -> Found<NoFigures> {
        Ok((threshold(volume, mask, self, exec)?, NoFigures {}))
    }
}

/// What a hierarchy takes, measured: 16.4 bytes a voxel where nearly every one is a leaf.
const HVS: Option<Memory> = Some(Memory { voxel: 17, reached: 0, triangle: 0 });

impl Op for HvsParams {
    const REVISION: u32 = 1;
    type Inputs<'a> = Scanned<'a>;
    type Gives = (Tree, TreeFigures);

    fn memory(&self) -> Option<Memory> {
        HVS
    }

    fn check_together(&self) -> Result<(), ParamError> {
        self.within.check()
    }

    fn run(&self, inputs: Scanned<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let found = region_tree(inputs.volume, inputs.mask, self, exec)?;
        let figures = TreeFigures::from(&found);
        Ok((found.tree, figures))
    }
}

/// A tree of merged regions, cut.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Hierarchy {
    /// How the tree is grown, where there is none yet.
    #[serde(flatten)]
    pub tree: HvsParams,
    /// How it is cut.
    #[serde(flatten)]
    pub cut: CutParams,
    /// What is done with the classes then.
    #[serde(flatten)]
    pub tidy: TidyParams,
}

impl Op for Hierarchy {
    const REVISION: u32 = REVISION;
    type Inputs<'a> = Grown<'a>;
    type Gives = (Labels, Figures<CutFigures>);

    fn memory(&self) -> Option<Memory> {
        HVS
    }

    fn check_together(&self) -> Result<(), ParamError> {
        self.tree.check_together()?;
        self.cut.check_together()
    }

    /// With a tree, the volume is looked at only where labels are changed by its values.
    fn wants(&self, slot: &str) -> Want {
        match slot {
            "volume" if self.tidy.is_any() => Want::Yes,
            "tree" => Want::Yes,
            _ => Want::No,
        }
    }

    fn precursor(&self) -> Option<Box<dyn Job>> {
        Some(Box::new(self.tree.clone()))
    }

    fn run(&self, inputs: Grown<'_>, exec: &Exec) -> Result<Self::Gives, Failure> {
        let (found, dendrogram, regions) = match (inputs.tree, inputs.volume) {
            (Some(tree), _) => {
                let (found, dendrogram) = drawn(tree, &self.cut, MOST_LEAVES, exec)?;
                (found, dendrogram, tree.leaf_count())
            }
            (None, Some(volume)) => {
                classes_of_tree((volume, inputs.mask), &self.tree, &self.cut, MOST_LEAVES, exec)?
            }
            (None, None) => return Err(Failure::usage("hvs cuts a tree or segments a volume; give one")),
        };
        let own = CutFigures { regions, dendrogram };
        Ok(told(tidied(inputs.volume, found, self.tidy, exec)?, own))
    }
}
