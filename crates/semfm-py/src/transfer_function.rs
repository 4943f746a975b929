//! `transfer`, the short call: two objects and a region in, a transferred region out.

use pyo3::prelude::*;
use semfm::PipelineSettings;

use crate::cloud::SemanticCloud;
use crate::errors;
use crate::interruptible::run;
use crate::matching::Matching;
use crate::mesh::GivenObject;
use crate::prepared::{GivenFeatures, OwnedFeatures, PreparedObject};
use crate::region::region_of;
use crate::settings::{Options, TransferSettings};
use crate::shape::check_shape_size;
use crate::shared::Shared;
use crate::transfer::Transfer;

/// One of the two objects, prepared or to be prepared.
enum Side {
    Ready(PreparedObject),
    Raw(GivenObject, OwnedFeatures),
}

impl Side {
    fn of(
        value: &Bound<'_, PyAny>,
        name: &str,
        given: &GivenFeatures<'_, '_>,
        settings: &PipelineSettings,
    ) -> PyResult<Self> {
        let py = value.py();
        if let Ok(prepared) = value.cast::<PreparedObject>() {
            if given.has_any() {
                let argument = format!("{name}_features");
                let expected = "nothing beside a PreparedObject, which has its features";
                return Err(errors::invalid(py, &argument, expected, "more"));
            }
            return Ok(Self::Ready(prepared.get().clone()));
        }
        let object = GivenObject::of(value, name)?;
        check_shape_size(py, object.mesh.n_vertices(), &settings.shape)?;
        let side = format!("{name}_");
        let features = OwnedFeatures::of(py, &side, &object.mesh, given, settings)?;
        Ok(Self::Raw(object, features))
    }

    fn mesh(&self) -> Shared<semfm::Mesh> {
        match self {
            Self::Ready(object) => object.mesh_inner(),
            Self::Raw(object, _) => object.mesh.clone(),
        }
    }

    fn prepare(
        self,
        settings: &PipelineSettings,
        task: &semfm::Task,
    ) -> semfm::Result<PreparedObject> {
        match self {
            Self::Ready(object) => Ok(object),
            Self::Raw(object, features) => features.prepare(&object, settings, task),
        }
    }
}

/// An object with what is said of its features.
type Given<'a, 'py> = (&'a Bound<'py, PyAny>, &'a GivenFeatures<'a, 'py>);

/// Both objects. Where one alone has embeddings, the other is shown to the encoder that made them, or to the named one.
fn sides(
    source: Given<'_, '_>,
    target: Given<'_, '_>,
    settings: &PipelineSettings,
) -> PyResult<(Side, Side)> {
    let is_bare =
        |(value, given): Given<'_, '_>| !given.has_any() && value.cast::<PreparedObject>().is_err();
    if source.1.embeddings.is_some() && is_bare(target) {
        let [source, target] = one_encoded((source, "source"), (target, "target"), settings)?;
        return Ok((source, target));
    }
    if target.1.embeddings.is_some() && is_bare(source) {
        let [target, source] = one_encoded((target, "target"), (source, "source"), settings)?;
        return Ok((source, target));
    }
    let source = Side::of(source.0, "source", source.1, settings)?;
    Ok((source, Side::of(target.0, "target", target.1, settings)?))
}

/// An object with embeddings, and another that joins it.
fn one_encoded(
    (with, name): (Given<'_, '_>, &str),
    (without, other_name): (Given<'_, '_>, &str),
    settings: &PipelineSettings,
) -> PyResult<[Side; 2]> {
    let given = GivenFeatures { encoder: None, ..*with.1 };
    let with = Side::of(with.0, name, &given, settings)?;
    let beside = match &with {
        Side::Raw(_, OwnedFeatures::Views(file)) => Some(file.clone()),
        _ => None,
    };
    let given = GivenFeatures { beside: beside.as_ref(), ..*without.1 };
    let without = Side::of(without.0, other_name, &given, settings)?;
    Ok([with, without])
}

/// Both sides prepared, side by side. Two objects that an encoder is to be shown are encoded as a
/// pair: in their own colours where both have some, by one start of the encoder.
fn prepare_both(
    source: Side,
    target: Side,
    settings: &PipelineSettings,
    task: &semfm::Task,
) -> semfm::Result<[PreparedObject; 2]> {
    let encoded = match (&source, &target) {
        (
            Side::Raw(a, OwnedFeatures::Encoder(encoder)),
            Side::Raw(b, OwnedFeatures::Encoder(_)),
        ) => Some(encoder.embed_pair(a.drawable(), b.drawable(), task)?),
        _ => None,
    };
    let (source, target) = match &encoded {
        None => rayon::join(|| source.prepare(settings, task), || target.prepare(settings, task)),
        Some(pair) => {
            let (a, b) = (source.mesh(), target.mesh());
            rayon::join(
                || Ok(PreparedObject::new(pair.source.prepare((*a).clone(), settings, task)?)),
                || Ok(PreparedObject::new(pair.target.prepare((*b).clone(), settings, task)?)),
            )
        }
    };
    Ok([source?, target?])
}

/// Transfers a demonstrated region from one object to another.
///
/// Where neither features, embeddings nor clouds are given, an encoder makes them.
///
/// Parameters
/// ----------
/// source : mesh_like or MeshFile or PreparedObject
///     The demonstrated object.
/// target : mesh_like or MeshFile or PreparedObject
///     The one to act on.
/// region : Region or path
///     Where the demonstration touched the source.
/// source_features : (n_source, d) array_like, optional
///     A feature vector per vertex, from any network.
/// target_features : (n_target, d) array_like, optional
/// source_embeddings : Embeddings or path, optional
///     Patch embeddings of rendered views, or of what a camera saw (`ObservedObject.embed`). Where one object alone has
///     some, the other is shown to the encoder that made them.
/// target_embeddings : Embeddings or path, optional
/// source_cloud : SemanticCloud, optional
///     Surface points with features, made by the caller.
/// target_cloud : SemanticCloud, optional
/// encoder : str, optional
///     Shown rendered views: ``builtin`` (where nothing of all this is given), a ``.net`` file, a
///     Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or ``package.module:Class``.
/// method : str, optional
///     ``fused`` (where neither this nor `settings` is given), ``semfm`` (the paper to the letter),
///     ``anchored``, ``sinkhorn``, ``nearest``, or ``wks``, which needs no features.
/// rule : str, optional
///     How a map transfers the region: ``preimage`` (where none is given) or ``image``.
/// seed : int, optional
///     Of everything drawn by chance; 0 where none is given.
/// second_opinion : bool, optional
///     Whether an independent method judges the result, too; the method's own default where none is
///     given: True where its confidence is the agreement of the two.
/// settings : TransferSettings, optional
///     Everything that can be set, in place of `method` and `rule`.
/// k : int, optional
///     Eigenpairs of each shape; 60, or what the mesh allows, where none is given.
/// working_vertices : int, optional
///     Simplify above this many vertices, 0 keeps them all; 10 000 where none is given.
/// cache : cache, optional
///     Where prepared shapes and embeddings are kept: a folder, or True for the user's own.
/// progress : progress, optional
///
/// Returns
/// -------
/// Transfer
///     A region that lands nowhere is no error but the verdict ``"refuse"``.
///
/// Examples
/// --------
/// >>> import semfm
/// >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in (0, 1))
/// >>> result = semfm.transfer(
/// ...     mug.mesh, kettle.mesh, mug.region,
/// ...     source_features=mug.shared_features(), target_features=kettle.shared_features())
/// >>> result.region.n_vertices == kettle.mesh.n_vertices
/// True
#[pyfunction]
#[pyo3(signature = (
    source, target, region, *, source_features=None, target_features=None, source_embeddings=None,
    target_embeddings=None, source_cloud=None, target_cloud=None, encoder=None, method=None, rule=None,
    seed=None, second_opinion=None, settings=None, k=None, working_vertices=None, cache=None,
    progress=None
))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments, one per setting")]
pub fn transfer(
    source: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    region: &Bound<'_, PyAny>,
    source_features: Option<&Bound<'_, PyAny>>,
    target_features: Option<&Bound<'_, PyAny>>,
    source_embeddings: Option<&Bound<'_, PyAny>>,
    target_embeddings: Option<&Bound<'_, PyAny>>,
    source_cloud: Option<&Bound<'_, SemanticCloud>>,
    target_cloud: Option<&Bound<'_, SemanticCloud>>,
    encoder: Option<&str>,
    method: Option<&str>,
    rule: Option<&str>,
    seed: Option<u64>,
    second_opinion: Option<bool>,
    settings: Option<&Bound<'_, TransferSettings>>,
    k: Option<usize>,
    working_vertices: Option<usize>,
    cache: Option<&Bound<'_, PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Transfer> {
    let py = source.py();
    let options =
        Options { method, rule, seed, second_opinion, settings, k, working_vertices, cache };
    let settings = options.pipeline(py)?;
    let of_source = GivenFeatures {
        features: source_features,
        embeddings: source_embeddings,
        cloud: source_cloud,
        encoder,
        beside: None,
    };
    let of_target = GivenFeatures {
        features: target_features,
        embeddings: target_embeddings,
        cloud: target_cloud,
        ..of_source
    };
    let (source, target) = sides((source, &of_source), (target, &of_target), &settings)?;
    let region = region_of(region, &source.mesh())?;
    let n = source.mesh().n_vertices();
    if region.n_vertices() != n {
        let expected = format!("a region of the source's {n} vertices");
        return Err(errors::invalid(py, "region", &expected, &region.n_vertices().to_string()));
    }
    run(py, progress, move |task| {
        let [source, target] = prepare_both(source, target, &settings, task)?;
        Matching::of(source, target, &settings.transfer, task)?.transferred(region)
    })
}
