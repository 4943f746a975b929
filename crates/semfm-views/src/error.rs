//! What can go wrong with views and embeddings.

use std::path::PathBuf;

use semfm_geom::io::FormatError;

/// Result of a call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every way in which views, embeddings or their files can fail.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A mesh, a camera or a task: what `semfm-geom` reports.
    #[error(transparent)]
    Geom(#[from] semfm_geom::Error),
    /// A number or an array outside what it may be.
    #[error("{what}: expected {expected}, found {found}")]
    Invalid {
        /// Name of the argument or field.
        what: String,
        /// What is allowed.
        expected: String,
        /// What was given.
        found: String,
    },
    /// There is no graphics driver that could render.
    #[error(
        "no graphics adapter: expected a Vulkan, Metal or DirectX 12 driver, found none ({reason})"
    )]
    NoGpu {
        /// What the search reported.
        reason: String,
    },
    /// The graphics driver failed.
    #[error("the graphics driver failed: {reason}")]
    Gpu {
        /// What it reported.
        reason: String,
    },
    /// Something is too large for the graphics driver.
    #[error("{what}: expected {expected} for this graphics driver, found {found}")]
    BeyondGpu {
        /// What is too large.
        what: &'static str,
        /// What the driver can take.
        expected: String,
        /// What was asked.
        found: String,
    },
    /// A file is not what its format demands.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// An MCAP file is damaged or breaks the rules of its container.
    #[error("{}: {place}: expected {expected}, found {found}", path.display())]
    Container {
        /// The file.
        path: PathBuf,
        /// Record and byte offset.
        place: String,
        /// What kind of damage it is.
        fault: Fault,
        /// What the MCAP specification demands there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// Views or embeddings were made of another mesh than the one they are used with.
    #[error("{}: made of the mesh {expected}, but used with the mesh {found}", path.display())]
    OtherMesh {
        /// The file of views or embeddings.
        path: PathBuf,
        /// The mesh that the file names: hash and counts.
        expected: String,
        /// The mesh at hand: hash and counts.
        found: String,
    },
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
}

impl Error {
    pub(crate) fn invalid(
        what: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Invalid { what: what.into(), expected: expected.into(), found: found.into() }
    }

    /// A short name of the kind of failure, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Geom(cause) => cause.code(),
            Self::Invalid { .. } => "invalid",
            Self::NoGpu { .. } => "no-gpu",
            Self::Gpu { .. } => "gpu",
            Self::BeyondGpu { .. } => "beyond-gpu",
            Self::Format(_) => "format",
            Self::Container { fault, .. } => fault.code(),
            Self::OtherMesh { .. } => "other-mesh",
            Self::Io { .. } => "io",
        }
    }

    /// Where in the file, or which argument; `None` where the failure has no place.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::Invalid { what, .. } => Some(what.clone()),
            Self::Format(error) => Some(error.place.clone()),
            Self::Container { place, .. } => Some(place.clone()),
            Self::Geom(cause) => cause.place(),
            _ => None,
        }
    }
}

/// The ways in which an MCAP container can be broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// The file ends before it should.
    Truncated,
    /// It does not begin or end as MCAP files do.
    Magic,
    /// A record stands where its kind may not.
    Opcode,
    /// A length runs past what holds it, or does not fit its content.
    Length,
    /// A size that is stated twice differs, or is not the true one.
    Size,
    /// Larger than the reader's limits.
    OverLimit,
    /// A checksum does not fit its bytes.
    Crc,
    /// Compressed bytes that cannot be decompressed.
    Decompress,
    /// A compression that the specification does not know.
    Unsupported,
    /// An id that is not allowed, or refers to nothing.
    Id,
    /// The same id, or the same key, declared twice in different ways.
    Conflict,
    /// An offset that does not point at what it should.
    Offset,
    /// A count or time that the data contradict.
    Count,
    /// Text that is not UTF-8.
    Text,
}

impl Fault {
    /// A short name for programs.
    pub fn code(self) -> &'static str {
        match self {
            Self::Truncated => "truncated",
            Self::Magic => "magic",
            Self::Opcode => "opcode",
            Self::Length => "length",
            Self::Size => "size",
            Self::OverLimit => "over-limit",
            Self::Crc => "crc",
            Self::Decompress => "decompress",
            Self::Unsupported => "unsupported",
            Self::Id => "id",
            Self::Conflict => "conflict",
            Self::Offset => "offset",
            Self::Count => "count",
            Self::Text => "text",
        }
    }
}
