//! Rendering by the graphics driver where there is one, else on the CPU.

use std::fmt;
use std::str::FromStr;
#[cfg(feature = "gpu")]
use std::sync::{Mutex, PoisonError};

use semfm_geom::suggestion::unknown_name;
use semfm_geom::{Mesh, Pinhole, Task};

#[cfg(feature = "gpu")]
use crate::GpuRenderer;
#[cfg(feature = "gpu")]
use crate::gpu::may_have_graphics_processor;
use crate::{Error, RenderSettings, Result, SurfaceColor, View, render};

/// Which renderer is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RendererChoice {
    /// A graphics processor where one answers, else the CPU.
    #[default]
    Auto,
    /// A graphics driver, be it one that draws on the CPU; or an error.
    Gpu,
    /// The CPU.
    Cpu,
}

impl RendererChoice {
    const ALL: [(Self, &'static str); 3] =
        [(Self::Auto, "auto"), (Self::Gpu, "gpu"), (Self::Cpu, "cpu")];
}

impl fmt::Display for RendererChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(choice, _)| choice == self).map_or("", |entry| entry.1);
        f.write_str(name)
    }
}

impl FromStr for RendererChoice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|(_, name)| *name == text);
        found.map(|entry| entry.0).ok_or_else(|| {
            let given = unknown_name(text, Self::ALL.map(|(_, name)| name));
            Error::invalid("renderer", "auto, gpu or cpu", given)
        })
    }
}

/// An open renderer. Opening a driver costs 50 to 100 ms, so it is done when there is something to
/// draw, and once.
#[derive(Debug)]
pub struct Renderer {
    #[cfg(feature = "gpu")]
    gpu: Option<GpuRenderer>,
    /// Whether the CPU takes over what the driver refuses.
    #[cfg(feature = "gpu")]
    falls_back: bool,
    /// Why the CPU took over the last time.
    #[cfg(feature = "gpu")]
    refusal: Mutex<Option<String>>,
    note: Option<String>,
}

impl Renderer {
    /// The renderer on the CPU, which needs nothing.
    pub fn cpu() -> Self {
        Self {
            #[cfg(feature = "gpu")]
            gpu: None,
            #[cfg(feature = "gpu")]
            falls_back: true,
            #[cfg(feature = "gpu")]
            refusal: Mutex::default(),
            note: None,
        }
    }

    /// The renderer on a driver; where it `falls_back`, the CPU takes over what the driver refuses.
    #[cfg(feature = "gpu")]
    pub(crate) fn with_gpu(gpu: GpuRenderer, falls_back: bool) -> Self {
        Self { gpu: Some(gpu), falls_back, ..Self::cpu() }
    }

    /// The renderer on the CPU with a note why it is not a driver.
    #[cfg(feature = "gpu")]
    fn cpu_because(note: String) -> Self {
        Self { note: Some(note), ..Self::cpu() }
    }

    /// Opens what is wanted. `Auto` opens no driver where the machine has no graphics processor, and
    /// passes over drivers that draw on the CPU themselves: they take longer and are less exact.
    ///
    /// # Errors
    /// For [`RendererChoice::Gpu`]: [`Error::NoGpu`] without a driver (or in a build without the
    /// feature `gpu`), [`Error::Gpu`] where it does not open.
    #[cfg(feature = "gpu")]
    pub fn open(choice: RendererChoice) -> Result<Self> {
        match choice {
            RendererChoice::Cpu => Ok(Self::cpu()),
            RendererChoice::Gpu => Ok(Self::with_gpu(GpuRenderer::new()?, false)),
            RendererChoice::Auto => Ok(Self::automatic()),
        }
    }

    #[cfg(feature = "gpu")]
    fn automatic() -> Self {
        if !may_have_graphics_processor() {
            return Self::cpu();
        }
        match GpuRenderer::new() {
            Ok(gpu) if gpu.is_software() => Self::cpu(),
            Ok(gpu) => Self::with_gpu(gpu, true),
            Err(error) => Self::cpu_because(format!("views are drawn on the CPU: {error}")),
        }
    }

    /// Opens what is wanted; in this build without the feature `gpu` that is the CPU.
    ///
    /// # Errors
    /// [`Error::NoGpu`] for [`RendererChoice::Gpu`].
    #[cfg(not(feature = "gpu"))]
    pub fn open(choice: RendererChoice) -> Result<Self> {
        match choice {
            RendererChoice::Gpu => {
                Err(Error::NoGpu { reason: "built without the feature `gpu`".into() })
            }
            RendererChoice::Auto | RendererChoice::Cpu => Ok(Self::cpu()),
        }
    }

    /// Why the CPU draws although a driver was asked for, known after opening or, where the driver
    /// refused, after drawing; nothing where all is as wanted.
    pub fn note(&self) -> Option<String> {
        #[cfg(feature = "gpu")]
        if let Some(reason) = self.refusal() {
            return Some(reason);
        }
        self.note.clone()
    }

    #[cfg(feature = "gpu")]
    fn refusal(&self) -> Option<String> {
        self.refusal.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The renderer's name, for reports: the driver's, or `CPU`; after drawing, of what drew.
    pub fn name(&self) -> String {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = self.gpu.as_ref().filter(|_| self.refusal().is_none()) {
            return gpu.name();
        }
        "CPU".to_owned()
    }

    /// One picture per camera: [`render`](crate::render()) on the driver or the CPU. A driver's pictures
    /// differ from the CPU's in single pixels at edges.
    ///
    /// # Errors
    /// As [`render`](crate::render()) and, of a driver that was asked for by name, [`Error::Gpu`],
    /// [`Error::BeyondGpu`] and [`Error::NoGpu`]; for [`RendererChoice::Auto`] the CPU draws then.
    pub fn render(
        &self,
        mesh: &Mesh,
        color: &SurfaceColor<'_>,
        cameras: &[Pinhole],
        settings: &RenderSettings,
        task: &Task,
    ) -> Result<Vec<View>> {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &self.gpu {
            let answer = gpu.render(mesh, color, cameras, settings, task);
            let refusal = match &answer {
                Err(
                    error @ (Error::Gpu { .. } | Error::BeyondGpu { .. } | Error::NoGpu { .. }),
                ) if self.falls_back => Some(format!("views are drawn on the CPU: {error}")),
                _ => None,
            };
            let is_refused = refusal.is_some();
            *self.refusal.lock().unwrap_or_else(PoisonError::into_inner) = refusal;
            if !is_refused {
                return answer;
            }
        }
        render(mesh, color, cameras, settings, task)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_back_and_other_words_refused() {
        for (choice, name) in RendererChoice::ALL {
            assert_eq!(name.parse::<RendererChoice>().unwrap(), choice);
            assert_eq!(choice.to_string(), name);
        }
        assert!("vulkan".parse::<RendererChoice>().is_err());
    }

    #[test]
    fn the_cpu_is_always_there() {
        let renderer = Renderer::open(RendererChoice::Cpu).unwrap();
        assert_eq!((renderer.name().as_str(), renderer.note()), ("CPU", None));
        assert!(Renderer::open(RendererChoice::Auto).is_ok());
    }
}
