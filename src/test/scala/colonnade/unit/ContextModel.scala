package colonnade.unit

import colonnade.shading.Occlusion

/** The expected state of a context and of its path. */
private class ContextModel(lights: Int) {
  var state         = ContextState.idle
  var isShadow      = false
  var isStraight    = false // it has left no surface of the object
  var hasColour     = false
  var isBackground  = false
  var hasHit        = false
  var occlusion     = Occlusion.none
  var shadowPending = Seq.empty[Int]
  var shadowLight   = 0
  var occlusions    = Seq.fill(lights)(Occlusion.none)
  var waited        = 0

  /** The pixel shows the environment; its ray is a Fresnel reflection. */
  var isDirectView        = false
  var isFresnelReflection = false

  /** The ray's hit may be hidden; it is tested. */
  var mayBeHidden     = false
  var isOcclusionTest = false

  /** Rays that its path has gathered; its surface is of the environment; the light of its surface is added, and then it gathers. */
  var gathered        = 0
  var isOfEnvironment = false
  var gathers         = false

  /** The ray of a point of the environment is complete, and what the shadow rays of that point have met. */
  var goesBack = false
  var kept     = Seq.empty[Occlusion.Type]

  /** Its primary ray cannot hit the object. */
  var bypasses = false

  /** The shader's result, if it is determined: a bounce, or a lit surface. */
  var willBounce = Option.empty[Boolean]
}
