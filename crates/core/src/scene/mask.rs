//! Cut-out masks: one bit per texel says whether a ray is stopped there.

use super::Wrap;
use glam::DVec2;

/// A cut-out mask (glTF's alpha mode MASK), looked up per texel.
#[derive(Clone, Debug, PartialEq)]
pub struct AlphaMask {
    /// Texels per row.
    pub width: u32,
    /// Rows; the first row is at v = 0.
    pub height: u32,
    /// Row by row, true where the surface is there.
    pub solid: Vec<bool>,
    /// Least alpha of the image that is solid: what lit outputs tell viewers, who cut the image again. (The file's
    /// alphaCutoff over its factor on alpha.) It changes no light.
    pub cutoff: f64,
    /// Repetition along u and v.
    pub wrap: [Wrap; 2],
}

impl AlphaMask {
    /// Is the surface there at texture coordinates `uv` (nearest texel)?
    #[must_use]
    pub fn is_solid(&self, uv: DVec2) -> bool {
        let column = texel(uv.x, self.width, self.wrap[0]);
        let row = texel(uv.y, self.height, self.wrap[1]);
        self.solid[row * self.width as usize + column]
    }
}

/// Index of the texel at coordinate `t` in a row of `count`.
fn texel(t: f64, count: u32, wrap: Wrap) -> usize {
    let unit = match wrap {
        Wrap::Repeat => t - t.floor(),
        Wrap::Clamp => t.clamp(0.0, 1.0),
        Wrap::Mirror => {
            let period = t - 2.0 * (t / 2.0).floor();
            if period > 1.0 { 2.0 - period } else { period }
        }
    };
    ((unit * f64::from(count)) as usize).min(count as usize - 1)
}
