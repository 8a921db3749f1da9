/* The size of a view, for callers that cannot read colonnade_view.h. */
#include "colonnade_view.h"

uint32_t colonnade_view_size(void);

uint32_t colonnade_view_size(void) { return sizeof(struct colonnade_view); }
