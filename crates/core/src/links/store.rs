//! All links, a list per receiver.

use super::Link;
use crate::tree::{ElementId, Elements};

/// Links by receiver. Each list is kept in the order of the sources' paths once its receiver has been refined, so
/// that sums over it do not depend on the order of work.
#[derive(Clone, Debug, Default)]
pub struct Links {
    lists: Vec<Vec<Link>>,
}

impl Links {
    /// Empty lists for so many receivers.
    #[must_use]
    pub fn new(receivers: usize) -> Links {
        Links { lists: vec![Vec::new(); receivers] }
    }

    /// Makes room for receivers that were created since.
    pub fn grow(&mut self, receivers: usize) {
        if self.lists.len() < receivers {
            self.lists.resize_with(receivers, Vec::new);
        }
    }

    /// Number of links.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lists.iter().map(Vec::len).sum()
    }

    /// True when there is no link.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lists.iter().all(Vec::is_empty)
    }

    /// Number of receivers that there is room for.
    #[must_use]
    pub fn receivers(&self) -> usize {
        self.lists.len()
    }

    /// Links of one receiver.
    #[must_use]
    pub fn of(&self, receiver: ElementId) -> &[Link] {
        &self.lists[receiver.index()]
    }

    /// Adds a link.
    pub fn push(&mut self, receiver: ElementId, link: Link) {
        self.lists[receiver.index()].push(link);
    }

    /// Takes a receiver's list out, to be worked on and put back.
    #[must_use]
    pub fn take(&mut self, receiver: ElementId) -> Vec<Link> {
        std::mem::take(&mut self.lists[receiver.index()])
    }

    /// Puts a receiver's list back, sorted by the paths of the sources.
    pub fn put(&mut self, receiver: ElementId, mut list: Vec<Link>, elements: &Elements) {
        list.sort_unstable_by_key(|link| elements.get(link.source).path);
        self.lists[receiver.index()] = list;
    }

    /// Puts a list back that is in order still.
    pub fn put_sorted(&mut self, receiver: ElementId, list: Vec<Link>) {
        self.lists[receiver.index()] = list;
    }

    /// Drops links whose visibility was never evaluated: what remains is consistent, if unfinished.
    pub fn drop_open(&mut self) {
        for list in &mut self.lists {
            list.retain(|link| link.visibility().is_some());
        }
    }

    /// Gives back memory that lists hold in reserve.
    pub fn shrink(&mut self) {
        self.lists.iter_mut().for_each(Vec::shrink_to_fit);
    }

    /// All links with their receivers, by receiver id.
    pub fn iter(&self) -> impl Iterator<Item = (ElementId, &Link)> {
        self.lists
            .iter()
            .enumerate()
            .flat_map(|(receiver, list)| list.iter().map(move |link| (ElementId(receiver as u32), link)))
    }
}
