//! Who does which piece of the work: the five modifications of the paper's Table 1 as switches, and the grain of tasks.

/// The switches between SPLASH-2's organisation (all off) and the one for the SB-PRAM (all on).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Switches {
    /// B': a task splits the polygons of its node in two lists, and each goes on by itself. Off: polygons are inserted one
    /// after the other.
    pub parallel_bsp: bool,
    /// F': one parallel loop over all pairs of roots finds form factor and visibility once for both directions. Off:
    /// F-tasks find form factors, in each direction by itself; visibilities follow in the first iteration.
    pub pair_loop: bool,
    /// V': a task finds form factor and visibility of one new link. Off: form factors are found by whoever makes the link,
    /// visibilities by V-tasks, several at a time.
    pub fine_tasks: bool,
    /// A': a parallel loop over leaves. Off: tasks go down the quadtrees.
    pub interpolation_loop: bool,
    /// One parallel queue. Off: a queue for each processor, and stealing.
    pub parallel_queue: bool,
}

impl Switches {
    /// SPLASH-2's organisation.
    pub const SPLASH: Switches = Switches {
        parallel_bsp: false,
        pair_loop: false,
        fine_tasks: false,
        interpolation_loop: false,
        parallel_queue: false,
    };
    /// The SB-PRAM's.
    pub const SB_PRAM: Switches = Switches {
        parallel_bsp: true,
        pair_loop: true,
        fine_tasks: true,
        interpolation_loop: true,
        parallel_queue: true,
    };
}

/// How much work makes a task. The defaults are those of SPLASH-2's program (its `radiosity.h`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Grain {
    /// A V-task finds so many visibilities, 1 to 4.
    pub visibilities: u32,
    /// With fewer open visibilities, an R-task finds them itself.
    pub least_visibilities: u32,
    /// An element with fewer links is not worth a task of its own.
    pub least_links: u32,
    /// A queue holds so many tasks; whoever finds it full runs the task itself.
    pub queue: u32,
}

impl Grain {
    /// SPLASH-2's default.
    pub const DEFAULT: Grain = Grain { visibilities: 4, least_visibilities: 4, least_links: 5, queue: 200 };
    /// The finest: everything is a task.
    pub const FINEST: Grain = Grain { visibilities: 1, least_visibilities: 1, least_links: 1, queue: 200 };
}

/// Which organisation works.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Schedule {
    /// Tasks.
    Tasks {
        /// With these modifications.
        switches: Switches,
        /// And this grain.
        grain: Grain,
    },
    /// Flat rounds of loops.
    Wavefront,
}

impl Schedule {
    /// SPLASH-2's organisation at its default grain.
    pub const SPLASH: Schedule = Schedule::Tasks { switches: Switches::SPLASH, grain: Grain::DEFAULT };
    /// The organisation for the SB-PRAM.
    pub const SB_PRAM: Schedule = Schedule::Tasks { switches: Switches::SB_PRAM, grain: Grain::FINEST };
}
