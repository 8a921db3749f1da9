package colonnade.shading

import colonnade.microcode.Label

/** Labels of [[BounceProgram]]. */
sealed trait BounceLabel extends Label

object BounceLabel {
  case object Idle            extends BounceLabel // waits for a hit
  case object GeometricNormal extends BounceLabel // normalises the geometric normal, which replaces the smooth one
  case object DotProducts     extends BounceLabel // computes the lengths of normal and ray, and their angle
  case object Reflect         extends BounceLabel // computes the reflected direction
  case object Discriminant    extends BounceLabel // computes Snell's discriminant
  case object Root            extends BounceLabel // takes the discriminant's root
  case object Refract         extends BounceLabel // computes the refracted direction
  case object HemisphereCheck extends BounceLabel // checks on which side of the surface the ray goes on
  case object Offset          extends BounceLabel // moves the origin to the other side of the surface
  case object Cosine          extends BounceLabel // computes the cosine for Schlick's approximation
  case object Fresnel         extends BounceLabel // computes Schlick's approximation of the Fresnel term
  case object Done            extends BounceLabel // offers the result
}
