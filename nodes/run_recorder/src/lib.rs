//! Every topic and both serial directions to one MCAP bag a run; reads bags too.
