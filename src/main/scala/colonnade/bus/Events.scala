package colonnade.bus

import chisel3._
import colonnade.axi.Axi
import colonnade.config.ShellConfig

/** The sources of the interrupt, in the order of their bits. */
object Interrupts {
  val ofFrames: Seq[String] = Seq("frameDone", "imageDone", "error") // and of batches
  val names:    Seq[String] = ofFrames :+ "refitDone"

  /** Those of a shell. */
  def of(shell: ShellConfig): Seq[String] = if (shell.refit) names else ofFrames
}

/** Errors of a frame's way to memory, bit 0 last. */
final class FramebufferError extends Bundle {
  val photoResponse = Bool()
  val photoWindow   = Bool()
  val format        = Bool()
  val alignment     = Bool()
  val response      = Bool()
  val window        = Bool()
}

/** Why an image was refused, bit 0 last. Sticky until the next load starts. */
final class ImageError extends Bundle {
  val length     = Bool()
  val section    = Bool()
  val formatHash = Bool()
  val magic      = Bool()
  val alignment  = Bool()
  val response   = Bool()
  val window     = Bool()
}

/** Bytes from `base` up to, and without, `end`. */
final class AddressWindow extends Bundle {
  val base = UInt(Axi.addressBits.W)
  val end  = UInt(Axi.addressBits.W)

  /** Whether `bytes` bytes from `address` on lie inside. */
  def contains(address: UInt, bytes: UInt): Bool = address >= base && (address +& bytes) <= end
}

/** Where an image lies. */
final class ImageSettings extends Bundle {
  val base   = UInt(Axi.addressBits.W)
  val bytes  = UInt(32.W)
  val window = new AddressWindow
}

/** Where pixels go. */
final class FramebufferSettings extends Bundle {
  val base     = UInt(Axi.addressBits.W)
  val stride   = UInt(24.W)
  val format   = UInt(PixelFormat.getWidth.W)
  val window   = new AddressWindow
  val photo    = new PhotoSettings
  val toStream = Bool() // to the pixel stream, not to memory
}

/** The camera's photo, XRGB8888 in sRGB, for the pixels that do not show the object. */
final class PhotoSettings extends Bundle {
  val isEnabled    = Bool()
  val hasStrengths = Bool() // X is the strength of the shadow, 255 a whole one
  val base         = UInt(Axi.addressBits.W)
  val stride       = UInt(24.W)
  val window       = new AddressWindow
}
