package colonnade.shading

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{FrameRegisters, Vec3}
import colonnade.numbers.{Fixed, FixedPointFormat}
import colonnade.ray.{Context, RayFormats}

final class BounceRequest(config: ColonnadeConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)
  val context     = Context(config)
  val origin      = Vec3(SInt(formats.pointBits.W))
  val normal      = Vec3(SInt(formats.narrowBits.W))
  val isSmooth    = Bool()
  val facing      = Vec3(SInt((NumberFormats.normalBits + 1).W))
  val towards     = Vec3(SInt((formats.shadeBits + 1).W))
  val backSide    = Bool()
  val isGlass     = Bool()
  val eta         = new Fixed(FixedPointFormat.unsigned(NumberFormats.etaBits, NumberFormats.etaFraction))
  val reflectance = FrameRegisters.share
}
final class BounceResult(config: ColonnadeConfig) extends Bundle {
  val context      = Context(config)
  val isRefraction = Bool()
  val origin       = Vec3(new Fixed(new RayFormats(config.numbers).scene))
  val towards      = Vec3(SInt(config.numbers.directionBits.W))
  val share        = FrameRegisters.share
}
final class BounceUnit(config: ColonnadeConfig) extends Module {
  val io = IO(new Bundle {
    val offset  = Input(UInt((config.numbers.gridBits - 2).W))
    val request = Flipped(Decoupled(new BounceRequest(config)))
    val result  = Decoupled(new BounceResult(config))
    val busy    = Output(Bool())
  })
  io := DontCare
}
