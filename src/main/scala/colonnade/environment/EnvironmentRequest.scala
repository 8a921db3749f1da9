package colonnade.environment

import chisel3._
import colonnade.common.Context
import colonnade.config.PathConfig

/** A context whose ray is to be traced to the environment. */
final class EnvironmentRequest(config: PathConfig) extends Bundle {
  val context             = Context(config)
  val isDirectView        = Bool() // the ray is the pixel's primary ray
  val isFresnelReflection = Bool() // the ray is the deferred Fresnel reflection of a path
  val isOcclusionTest     = Bool() // the ray has hit the object: does the environment hide the hit?
}

/** Which requests are accepted in this cycle: rays from the camera, and others. So one kind does not wait for the other. */
final class EnvironmentAccepts extends Bundle {
  val directView = Bool()
  val march      = Bool()
}
