//! faer on the calling thread: dense algebra is sequential inside, threads are shared out by shapes.

use std::sync::Once;

use faer::Par;

/// Makes faer's operators and decompositions run on the calling thread, for the whole process.
///
/// By default faer splits them by the number of threads it finds, and each split rounds
/// differently: the same seed would give other bytes on another machine. Our matrices are small,
/// and parallel work is shared out by shapes, views and blocks of rows instead. Every function that
/// leads to dense algebra calls this; only the first call does anything, so a program that wants
/// parallel faer for itself may set it again afterwards and gives up that promise.
pub fn keep_faer_sequential() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| faer::set_global_parallelism(Par::Seq));
}
