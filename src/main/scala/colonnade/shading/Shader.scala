package colonnade.shading

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.{NumberFormats, PathConfig, UnitsConfig}
import colonnade.formats.{Light, Material, Shading}

/** Ports of [[Shader]]; the registers are constant while it is busy. */
final class ShaderIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val lights    = Input(Vec(config.device.frame.lights, new Light(numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))
  val shading   = Input(new Shading(config.device))
  val materials = Input(Vec(config.device.frame.materials, new Material(config.device)))
  val request   = Flipped(Decoupled(new ShadeRequest(config)))

  /** Points of the environment; taken when there is no request. */
  val environment = if (config.device.hasEnvironment) Some(Flipped(Decoupled(new EnvironmentSurface(config)))) else None

  val readyNext = Output(Bool()) // `request` is ready in the next cycle

  /** To the textures, and whether a texel was illegal. */
  val texture        = config.device.geometry.texture.map(_ => new TexturePort(config))
  val isIllegalTexel = config.device.geometry.texture.map(_ => Output(Bool()))

  /** A hit on a diffuse surface asks for its sample point. */
  val sample = Option.when(config.device.frame.gather)(new SamplePort(config))

  /** Hits on diffuse surfaces; those on mirrors and glass. */
  val lit     = Decoupled(new LitSurface(config))
  val bounced = Option.when(config.device.frame.hasBounces)(Decoupled(new BouncedRay(config)))

  val busy = Output(Bool()) // the entry holds a hit: a cycle of the narrowest stage
}

/** Shades hits: docs/numbers.md, 5 and 6. Lit surfaces leave in the order of their hits. */
abstract class Shader(config: PathConfig) extends Module {
  final val io = IO(new ShaderIO(config))

  /** A light's entry; a single light needs no index. */
  protected def at[T <: Data](entries: Vec[T], index: UInt): T =
    if (config.device.frame.lights == 1) entries.head else entries(index)
}

object Shader {

  /** The smallest unit that takes a light on a hit every `units.shadeInterval` cycles. */
  def apply(config: PathConfig): Shader =
    if (config.device.units.shadeInterval >= UnitsConfig.sequentialShadeInterval) new SequentialShader(config)
    else new ShadingPipeline(config)
}
