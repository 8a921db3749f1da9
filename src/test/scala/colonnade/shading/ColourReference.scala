package colonnade.shading

import colonnade.config.ColonnadeConfig

/** The colours of paths in the integers of docs/numbers.md, sections 5.9 and 6.7.
  *
  * @param shadowTransmittance of the light that transmissive triangles leave, of 4096
  */
final class ColourReference(
    config:              ColonnadeConfig,
    ambient:             Seq[Int],
    background:          Seq[Int],
    shadowTransmittance: Int
) {
  import ColourEvent._

  private type Xyz = Seq[Int]

  private val one   = 4096
  private val white = 4095

  /** Colours of the paths of one context, and the shadow ratios of those that have one. Paths end before the last event. */
  def colours(events: Seq[ColourEvent]): Seq[(Xyz, Option[Xyz])] = {
    var throughput, radiance           = Seq.empty[Int]
    var surface                        = Option.empty[LitColours]
    var gathered                       = Seq.empty[Int]
    def add(part: Xyz, seen: Xyz): Xyz =
      Seq(radiance, part, seen).transpose.map { case Seq(sure, part, seen) =>
        white.min(sure + (part.toLong * seen >> 12).toInt)
      }
    events.flatMap {
      case Start =>
        throughput = Seq.fill(3)(one)
        radiance = Seq.fill(3)(0)
        None
      case Remember(what) =>
        surface = Some(what)
        None
      case Bounce(albedo, isTinted, fresnel, hasSurface, light) =>
        val tinted = throughput.zip(albedo).map { case (weight, tint) =>
          if (isTinted) weight * (tint + (tint >> 11)) >> 12 else weight
        }
        val parts = tinted.map(_ * fresnel >> 12)
        val seen  =
          if (hasSurface) leaving(surface.get, unshadowed(surface.get)) else light.getOrElse(background)
        radiance = add(parts, seen)
        throughput = tinted.zip(parts).map { case (weight, part) => weight - part }
        None
      case Gather(occlusions) =>
        val what  = surface.get
        val light = visible(what, occlusions).zip(ambient).map { case (all, ambient) => all - ambient }
        radiance = add(throughput, leaving(what, light))
        throughput = throughput.zip(what.albedo).map { case (weight, tint) => weight * (tint + (tint >> 11)) >> 12 }
        None
      case EndInCube(light)                     => Some(add(throughput, light) -> None)
      case End(true, _, _)                      => Some(add(throughput, background) -> None)
      case End(false, occlusions, isDirectView) =>
        val what  = surface.get
        val light = visible(what, occlusions)
        Some(add(throughput, leaving(what, light)) -> Option.when(isDirectView)(ratio(light, unshadowed(what))))
      case GoBack(light, occlusions) =>
        gathered =
          light.map(add(throughput, _)).getOrElse(add(
            throughput,
            leaving(surface.get, visible(surface.get, occlusions))
          ))
        None
      case EndWithGathered(occlusions) =>
        val light = Seq(visible(surface.get, occlusions), gathered, ambient).transpose.map {
          case Seq(all, gathered, ambient) =>
            all - ambient + gathered
        }
        Some(leaving(surface.get, light) -> Some(ratio(light, unshadowed(surface.get))))
    }
  }

  /** Less than 2; 1 for 0 / 0. */
  private def ratio(part: Xyz, whole: Xyz): Xyz = part.zip(whole).map { case (part, whole) =>
    if (part == whole) one else if (part < 2 * whole) (part.toLong * one / whole).toInt else 2 * one - 1
  }

  private def unshadowed(surface: LitColours): Xyz = visible(surface, surface.direct.map(_ => 0))

  private def visible(surface: LitColours, occlusions: Seq[Int]): Xyz = ambient.indices.map { channel =>
    ambient(channel) + surface.direct.zip(occlusions).map { case (direct, occlusion) =>
      val share = Seq(one, shadowTransmittance, 0)(occlusion)
      (direct(channel).toLong * share >> 12).toInt
    }.sum
  }

  /** What a surface reflects of the light, and emits. */
  private def leaving(surface: LitColours, light: Xyz): Xyz =
    Seq(surface.albedo, light, surface.emission).transpose.map { case Seq(albedo, light, emission) =>
      val reflected = (albedo.toLong * light >> 12).min(white).toInt
      if (config.frame.emission) (reflected + emission).min(white) else reflected
    }
}
