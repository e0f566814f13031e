//! Tests of conditioning and identification.

mod identify_campaign;
mod identify_criterion;
mod identify_findings;
mod identify_presliding;
mod identify_recordings;
mod identify_round_trip;
mod identify_sampling;
mod identify_transmission;
mod random_transmissions;
mod recording_conditioning;
mod recording_conditioning_drive;
