//! Where the pieces of a surface are kept: all of them, or, for a surface of very many patches, only their boxes, each
//! patch being made into a piece when a search comes to it.

use super::extract::{Span, bezier_net, spans};
use super::interval::hull;
use super::piece::{Piece, Pieces, make, powers};
use crate::nurbs::NurbsSurface;
use glam::{DVec2, DVec3, DVec4};
use rayon::prelude::*;

/// Patches of which all pieces are kept; a piece takes 1.4 kB.
const MOST_KEPT: usize = 1 << 16;
/// Slots of a cache along u and v.
const SLOTS: [usize; 2] = [16, 32];

/// All pieces, or what makes them.
#[derive(Clone, Debug)]
pub(super) struct Store {
    pieces: Pieces,
    /// The spans along u and v where pieces are made on demand.
    spans: Option<[Vec<Span>; 2]>,
}

/// The pieces that a worker made last.
#[derive(Debug, Default)]
pub(super) struct Cache {
    pieces: Pieces,
    /// Which piece each slot holds.
    ids: Vec<usize>,
}

impl Store {
    pub(super) fn new(surface: &NurbsSurface) -> Self {
        let [u, v] = [surface.knots_u(), surface.knots_v()]
            .map(|knots| knots.breakpoints().len().saturating_sub(1));
        Self::keeping(surface, u.saturating_mul(v) <= MOST_KEPT)
    }

    /// With all pieces kept, or none.
    pub(super) fn keeping(surface: &NurbsSurface, all: bool) -> Self {
        if all {
            return Self {
                pieces: Pieces::new(surface),
                spans: None,
            };
        }
        let [u, v] = [spans(surface.knots_u()), spans(surface.knots_v())];
        let row = |sv: &Span| -> Vec<[DVec3; 2]> {
            u.iter()
                .map(|su| {
                    let net = bezier_net(surface, su, sv);
                    hull(net.iter().map(|h| h.truncate() / h.w))
                })
                .collect()
        };
        let rows: Vec<Vec<[DVec3; 2]>> = v.par_iter().map(row).collect();
        let pieces = Pieces {
            degree: surface.degree(),
            rational: surface.is_rational(),
            boxes: rows.into_iter().flatten().collect(),
            breaks: [&u, &v].map(|s| s.iter().map(|s| s.ends.0).collect()),
            ..Pieces::default()
        };
        Self {
            pieces,
            spans: Some([u, v]),
        }
    }

    /// The boxes of the pieces; they are needed only once.
    pub(super) fn take_boxes(&mut self) -> Vec<[DVec3; 2]> {
        std::mem::take(&mut self.pieces.boxes)
    }
    /// The rectangles `[u_0, u_1, v_0, v_1]` of all pieces.
    pub(super) fn domains(&self) -> Vec<[f64; 4]> {
        let Some([u, v]) = &self.spans else {
            return self.pieces.all.iter().map(|piece| piece.domain).collect();
        };
        let row = |sv: &Span| {
            let (c, d) = sv.ends;
            u.iter().map(move |su| [su.ends.0, su.ends.1, c, d])
        };
        v.iter().flat_map(row).collect()
    }
    /// Number of control points of a piece.
    pub(super) fn net_len(&self) -> usize {
        self.pieces.net_len()
    }
    /// The piece that holds these parameters of the domain.
    pub(super) fn at(&self, uv: DVec2) -> usize {
        self.pieces.at(uv)
    }

    /// Pieces among which `piece` is, and its place there.
    #[inline]
    pub(super) fn load<'a>(
        &'a self,
        surface: &NurbsSurface,
        cache: &'a mut Cache,
        piece: usize,
    ) -> (&'a Pieces, usize) {
        match &self.spans {
            None => (&self.pieces, piece),
            Some(spans) => {
                let slot = self.fetch(surface, spans, cache, piece);
                (&cache.pieces, slot)
            }
        }
    }

    /// Makes the piece unless its slot of the cache holds it; returns the slot.
    fn fetch(
        &self,
        surface: &NurbsSurface,
        [u, v]: &[Vec<Span>; 2],
        cache: &mut Cache,
        id: usize,
    ) -> usize {
        let (i, j) = (id % u.len(), (id / u.len()).min(v.len() - 1));
        let slot = i % SLOTS[0] + SLOTS[0] * (j % SLOTS[1]);
        let [p, q] = self.pieces.degree;
        let length = self.net_len();
        let count = SLOTS[0] * SLOTS[1];
        let cubic = p <= 3 && q <= 3;
        if cache.ids.is_empty() {
            cache.ids = vec![usize::MAX; count];
            cache.pieces = Pieces {
                all: vec![Piece::default(); count],
                degree: [p, q],
                rational: self.pieces.rational,
                nets: vec![DVec4::W; count * length],
                powers: vec![[[0.0; 4]; 16]; if cubic { count } else { 0 }],
                ..Pieces::default()
            };
        }
        if cache.ids[slot] != id {
            let (su, sv) = (&u[i], &v[j]);
            let net = bezier_net(surface, su, sv);
            let domain = [su.ends.0, su.ends.1, sv.ends.0, sv.ends.1];
            let (piece, net, _, _) = make(&net, [p, q], domain, self.pieces.rational);
            if cubic {
                cache.pieces.powers[slot] = powers(&net, [p, q]);
            }
            cache.pieces.nets[slot * length..(slot + 1) * length].copy_from_slice(&net);
            cache.pieces.all[slot] = piece;
            cache.ids[slot] = id;
        }
        slot
    }
}
