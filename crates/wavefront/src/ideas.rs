//! The ideas that the engine is made of, each with a switch, so that what one of them buys can be measured.

macro_rules! ideas {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// Which ideas a solve uses: all, unless one is to be measured by leaving it out.
        ///
        /// Switches act on [`crate::Prepared::solve`]; light by groups takes all ideas for granted.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Ideas {
            $($(#[$doc])* pub $name: bool,)*
        }

        impl Default for Ideas {
            fn default() -> Self {
                Ideas { $($name: true,)* }
            }
        }

        impl Ideas {
            /// The name of each idea, and all ideas but that one.
            #[must_use]
            pub fn each_left_out() -> Vec<(&'static str, Ideas)> {
                vec![$((stringify!($name), Ideas { $name: false, ..Ideas::default() }),)*]
            }
        }
    };
}

ideas! {
    /// Groups of polygons exchange light as one. Without, every pair of polygons is evaluated by itself. Where a bound ends
    /// refinement before all pairs are reached, those that are left stay between clusters even so.
    clusters,
    /// Irradiance over an element is a quadratic function. Without, what a link brings is the same all over its receiver,
    /// and so is a leaf's field; what factors vary counts as an error of the link.
    linear_receivers,
    /// A link reads the radiosity at the place on the source where its light comes from. Without, it reads the mean.
    linear_sources,
    /// Leaves take form factors at their own points. Without, the factors of links are interpolated, and what the corners
    /// have beyond that counts as an error of the link.
    leaves_anew,
    /// Leaves interpolate those factors that are smooth over the link's receiver. Without, they take all anew.
    smooth_factors,
    /// Where leaves see lit surfaces wherever they look, what rays miss is shared out so that all factors add up to 1. Without,
    /// every link keeps what its own rays found.
    closed_rows,
    /// Leaves see large sources that are near part by part. Without, such a source is as bright all over as the link reads.
    parts_nearby,
    /// Where what rays leave open is a link's largest error, more rays are asked. Without, it is split.
    more_rays,
    /// Rays count by what they would carry. Without, all that carry anything count the same.
    weighted_rays,
    /// Which strata of the two ends of a link are joined by rays depends on the link. Without, they are the same for all.
    hashed_pairing,
    /// One packet of rays tells of both directions of a pair. Without, each direction sends its own.
    shared_rays,
    /// Pairs between which nothing lies are proven to be clear when they are split: their parts need no rays. Without, they
    /// send them.
    clear_proofs,
    /// Links that one surface is proven to hide are dropped. Without, they are asked and split as others whose rays are
    /// blocked.
    blocked_proofs,
    /// Links whose rays are all blocked are asked again where their source would matter. Without, they are dropped.
    dark_links,
    /// Rays meet parallelograms as one primitive. Without, as two triangles, in a tree that the solve makes at its begin.
    parallelograms,
    /// Elements of more than eight times their width are cut into strips. Without, into quarters, which are as long.
    strips,
    /// Elements that a line of contact runs through know which of their parts are open, and are split along it. Without, a
    /// polygon is open or covered as a whole.
    contact_lines,
}
