//! The three programs that the driver runs, and what they read.

use super::device::Device;

/// Triangle and bits of the depth of a pixel.
pub(super) const ID_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
pub(super) const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// One corner of a triangle as the driver gets it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Corner {
    /// Relative to the centre of the bounding sphere, in units of its radius.
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub color: [f32; 3],
}

/// A camera as the driver gets it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct CameraBlock {
    pub clip_from_mesh: [f32; 16],
    pub light: [f32; 4],
    pub per_pixel: u32,
    pub padding: [u32; 3],
}

/// `identify` draws triangle and depth, `shade` the samples' colours, `average` the picture.
pub(super) struct Pipelines {
    pub identify: wgpu::RenderPipeline,
    pub shade: wgpu::RenderPipeline,
    pub average: wgpu::RenderPipeline,
    pub camera_layout: wgpu::BindGroupLayout,
    pub samples_layout: wgpu::BindGroupLayout,
    /// Reads the mean of what lies around a position.
    pub between: wgpu::Sampler,
}

impl Pipelines {
    pub fn new(device: &Device) -> Self {
        let device = &device.device;
        let source = wgpu::ShaderSource::Wgsl(include_str!("shaders.wgsl").into());
        let module = device
            .create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("views"), source });
        let camera = (
            0,
            wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: true,
                min_binding_size: std::num::NonZero::new(size_of::<CameraBlock>() as u64),
            },
        );
        let samples = (
            1,
            wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: true },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            },
        );
        let between = (2, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering));
        let camera_layout = layout(device, &[camera]);
        let samples_layout = layout(device, &[camera, samples, between]);
        let program = Program { device, module: &module };
        Self {
            identify: program.of_mesh(&camera_layout, "place", "identify", ID_FORMAT),
            shade: program.of_mesh(&camera_layout, "light", "shade", COLOR_FORMAT),
            average: program.pipeline(&samples_layout, "cover", "average", COLOR_FORMAT, &[], None),
            camera_layout,
            samples_layout,
            between: device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
        }
    }
}

fn layout(device: &wgpu::Device, entries: &[(u32, wgpu::BindingType)]) -> wgpu::BindGroupLayout {
    let entry = |&(binding, ty): &(u32, wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
        ty,
        count: None,
    };
    let entries: Vec<_> = entries.iter().map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &entries,
    })
}

struct Program<'a> {
    device: &'a wgpu::Device,
    module: &'a wgpu::ShaderModule,
}

impl Program<'_> {
    /// A pipeline that draws the mesh's triangles, both sides of each. Of two at one depth it keeps
    /// the first, whose id is lower.
    fn of_mesh(
        &self,
        reads: &wgpu::BindGroupLayout,
        vertex: &str,
        fragment: &str,
        format: wgpu::TextureFormat,
    ) -> wgpu::RenderPipeline {
        let corner = wgpu::VertexBufferLayout {
            array_stride: size_of::<Corner>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3],
        };
        let depth = wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        };
        self.pipeline(reads, vertex, fragment, format, &[Some(corner)], Some(depth))
    }

    fn pipeline(
        &self,
        reads: &wgpu::BindGroupLayout,
        vertex: &str,
        fragment: &str,
        format: wgpu::TextureFormat,
        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
        depth_stencil: Option<wgpu::DepthStencilState>,
    ) -> wgpu::RenderPipeline {
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(reads)],
            immediate_size: 0,
        });
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(fragment),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: self.module,
                entry_point: Some(vertex),
                compilation_options: Default::default(),
                buffers,
            },
            fragment: Some(wgpu::FragmentState {
                module: self.module,
                entry_point: Some(fragment),
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            primitive: Default::default(),
            depth_stencil,
            multisample: Default::default(),
            multiview_mask: None,
            cache: None,
        })
    }
}
