package colonnade.environment

import chisel3._
import chisel3.util.{RegEnable, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{Load, Plane, ShellEntry}

/** Ports of [[PlaneTable]]. */
final class PlaneTableIO(config: ColonnadeConfig, tagBits: Int) extends Bundle {
  val load   = Flipped(Valid(new Load(config)))
  val planes = Flipped(new AttributeChannel(new PlaneQuestion(AttributeLayout.of(config)), new ShellEntry, tagBits))
}

/** The planes themselves: those that cells name, and those of the shell. Latency one cycle, one plane a cycle. */
final class PlaneTable(config: ColonnadeConfig, tagBits: Int) extends Module {
  val io = IO(new PlaneTableIO(config, tagBits))

  private val table    = AttributeStore(config, "planes.planes", io.load)
  private val shell    = AttributeStore(config, "planes.shell", io.load)
  private val question = io.planes.question

  question.ready   := true.B
  table.read.valid := question.valid && !question.bits.content.isShell
  table.read.bits  := question.bits.content.index
  shell.read.valid := question.valid && question.bits.content.isShell
  shell.read.bits  := question.bits.content.index

  private val isShell = RegEnable(question.bits.content.isShell, question.valid)
  private val entry   = shell.word.asTypeOf(new ShellEntry)
  io.planes.answer.valid              := RegNext(question.valid, false.B)
  io.planes.answer.bits.tag           := RegEnable(question.bits.tag, question.valid)
  io.planes.answer.bits.isIllegal     := false.B
  io.planes.answer.bits.content       := entry
  io.planes.answer.bits.content.plane := Mux(isShell, entry.plane, table.word.asTypeOf(new Plane))
}
